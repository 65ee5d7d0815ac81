#!/usr/bin/env python3
"""Checks the C# binding against the C ABI's manifest: every function with its signature, every struct with sizes and
offsets, every constant with its value, and nothing that the ABI does not have.

Usage: check_binding.py MANIFEST LIBRARY [--faults] -- COMMAND...

COMMAND prints what the compiled binding holds (describe_binding.cs). LIBRARY is where functions are to be looked up.
--faults changes the manifest in many ways, each of which must be found.
"""
import argparse
import copy
import json
import re
import subprocess
import sys

TYPES = {"dcloth_status": "Int32", "uint32_t": "UInt32", "int32_t": "Int32", "uint64_t": "UInt64", "size_t": "UIntPtr",
         "float": "Single", "char": "Byte", "void": "Void", "uint16_t": "UInt16", "uint8_t": "Byte"}


def csharp(kind, constants):
    """The C# type of a C type: const goes, a function pointer is an address, an array a fixed buffer."""
    if "(*)" in kind:
        return "IntPtr"
    array = re.fullmatch(r"(.+)\[(\w+)\]", kind)
    if array:
        count = constants[array[2]] if array[2] in constants else int(array[2])
        return f"{csharp(array[1], constants)}[{count}]"
    kind = re.sub(r"\bconst\b", "", kind)
    name, stars = re.fullmatch(r"\s*(\w+)\s*([*\s]*)", kind).groups()
    return TYPES.get(name, name) + stars.replace(" ", "")


def expectation(manifest, library):
    """The lines that a binding of this manifest prints."""
    constants, lines = manifest["constants"], set()
    for name, declaration in manifest["functions"].items():
        result, parameters = re.fullmatch(rf"(.+?)\b{name}\((.*)\)", declaration).groups()
        list_ = []
        for parameter in [] if parameters == "void" else parameters.split(","):
            kind, own = re.fullmatch(r"\s*(.+?)(\w+)", parameter).groups()
            list_.append(f"{csharp(kind, constants)} {own}")
        lines.add(f"function {name} {csharp(result, constants)}({', '.join(list_)}) {library} Cdecl")
    named = set(re.findall(r"\b(dcloth_(?!status)\w+)\*", " ".join(manifest["functions"].values())))
    lines |= {f"struct {name} 0" for name in named - set(manifest["structs"])}  # opaque
    for name, struct in manifest["structs"].items():
        lines.add(f"struct {name} {struct['bytes']}")
        for field in struct["fields"]:
            kind = csharp(field["type"], constants)
            lines.add(f"field {name} {field['name']} {kind} {field['offset']} {field['bytes']}")
    return lines | {f"constant {name} {value}" for name, value in constants.items()}


def faults(manifest):
    """Every function retyped and dropped, every struct and field changed, every constant raised, one more of each."""
    def changed(change):
        copied = copy.deepcopy(manifest)
        change(copied)
        return copied

    for name, text in manifest["functions"].items():
        yield f"{name} dropped", changed(lambda m: m["functions"].pop(name))
        for kind, other in (("uint32_t ", "uint64_t "), ("size_t ", "uint32_t "), ("float ", "double ")):
            if kind in text:
                yield f"{name}: {other}", changed(lambda m: m["functions"].update({name: text.replace(kind, other, 1)}))
    yield "a function more", changed(lambda m: m["functions"].update(dcloth_more="dcloth_status dcloth_more(void)"))
    for name, struct in manifest["structs"].items():
        yield f"{name} grown", changed(lambda m: m["structs"][name].update(bytes=struct["bytes"] + 8))
        yield f"{name} dropped", changed(lambda m: m["structs"].pop(name))
        for i, field in enumerate(struct["fields"]):
            for key, value in (("offset", field["offset"] + 4), ("bytes", field["bytes"] * 2),
                               ("name", field["name"] + "_"), ("type", "double")):
                yield (f"{name}.{field['name']}: {key}",
                       changed(lambda m: m["structs"][name]["fields"][i].update({key: value})))
    for name, value in manifest["constants"].items():
        yield f"{name} + 1", changed(lambda m: m["constants"].update({name: value + 1}))
        yield f"{name} dropped", changed(lambda m: m["constants"].pop(name))
    yield "a constant more", changed(lambda m: m["constants"].update(DCLOTH_MORE=1))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("manifest")
    parser.add_argument("library")
    parser.add_argument("--faults", action="store_true")
    parser.add_argument("command", nargs="+")
    options = parser.parse_args()
    with open(options.manifest, encoding="utf-8") as file:
        manifest = json.load(file)
    done = subprocess.run(options.command, check=True, capture_output=True, text=True)
    found, expected = set(done.stdout.splitlines()), expectation(manifest, options.library)
    kinds = ("function", "struct", "field", "constant")
    counts = {kind: sum(line.startswith(kind + " ") for line in found) for kind in kinds}
    print("binding: " + ", ".join(f"{count} {kind}s" for kind, count in counts.items()))
    for line in sorted(expected - found):
        print(f"error: {options.manifest} says '{line}', the binding does not", file=sys.stderr)
    for line in sorted(found - expected):
        print(f"error: the binding says '{line}', {options.manifest} does not", file=sys.stderr)
    if not all(counts.values()):
        print("error: a kind of fact is missing altogether; was the binding read?", file=sys.stderr)
        return 1
    if found != expected:
        return 1
    seeded = 0
    for what, changed in faults(manifest) if options.faults else ():
        seeded += 1
        try:
            unseen = expectation(changed, options.library) == found
        except ValueError:  # an array's length is a constant that is gone
            unseen = False
        if unseen:
            print(f"error: a seeded fault was not found: {what}", file=sys.stderr)
            return 1
    if options.faults:
        print(f"{seeded} seeded faults, all found")
        return 0 if seeded else 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
