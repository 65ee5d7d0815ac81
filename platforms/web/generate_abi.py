#!/usr/bin/env python3
"""Turns the C ABI's manifest into what a WebAssembly host needs, laid out for 32-bit pointers.

Usage: generate_abi.py MANIFEST [--js FILE] [--exports FILE] [--asserts FILE] [--check]

--js: constants, struct offsets and the types of the module's functions (platforms/web/api/abi.js, which is kept in the
repository). --exports: names for the linker, one a line. --asserts: a C source that fails to compile where the
compiler's layout is another. --check writes nothing and fails where --js is not what would be written.
"""
import argparse
import json
import re
import sys

# C type: bytes (and alignment) on wasm32, type of an argument or result in JavaScript.
SCALARS = {"uint16_t": (2, "number"), "uint32_t": (4, "number"), "int32_t": (4, "number"),
           "dcloth_status": (4, "number"),
           "size_t": (4, "number"), "uint64_t": (8, "bigint"), "float": (4, "number"), "char": (1, "number")}
POINTER_BYTES = 4
# Beside the C ABI: lent memory comes from here, and steps are timed by the host's clock (clock.c).
OWN_EXPORTS = {"aligned_alloc": "(alignment: number, size: number) => number", "free": "(address: number) => void",
               "dcloth_web_clock_address": "() => number"}


def is_pointer(kind):
    return kind.endswith("*") or "(*)" in kind


def layout(fields, constants):
    """([(name, offset, bytes, count)], bytes of the struct, its alignment) by the rules of C."""
    placed, at, alignment = [], 0, 1
    for field in fields:
        kind, count = field["type"], 1
        array = re.fullmatch(r"(.+)\[(\w+)\]", kind)
        if array and not is_pointer(kind):
            kind, count = array[1], constants[array[2]] if array[2] in constants else int(array[2])
        size = POINTER_BYTES if is_pointer(kind) else SCALARS[kind][0]
        at = -(-at // size) * size
        placed.append((field["name"], at, size * count, count))
        at += size * count
        alignment = max(alignment, size)
    return placed, -(-at // alignment) * alignment


def signature(name, declaration):
    """A function's type in JavaScript, as a property of Exports."""
    result, parameters = re.fullmatch(rf"(.+?)\b{name}\((.*)\)", declaration).groups()
    arguments = []
    for parameter in [] if parameters == "void" else parameters.split(","):
        kind, own = re.fullmatch(r"\s*(.+?)\s*(\w+)", parameter).groups()
        arguments.append(f"{own}: {'number' if is_pointer(kind) else SCALARS[kind][1]}")
    result = result.strip()
    head = f" * @property {{({', '.join(arguments)})"
    tail = f"=> {'number' if is_pointer(result) else SCALARS[result][1]}}} {name}"
    return f"{head} {tail}" if len(head) + len(tail) < 120 else f"{head}\n *   {tail}"


def javascript(manifest):
    lines = ["// Made by platforms/web/generate_abi.py from engine/abi.json; a test compares. Not edited by hand.",
             "// Offsets are bytes on wasm32; the build checks them against the compiler's.", ""]
    lines += [f"export const {name} = {value};" for name, value in manifest["constants"].items()]
    for name, struct in manifest["structs"].items():
        placed, size = layout(struct["fields"], manifest["constants"])
        lines += ["", f"export const {name} = Object.freeze({{", f"  bytes: {size},"]
        lines += [f"  {field}: {offset}," for field, offset, _, _ in placed]
        lines.append("});")
    lines += ["", "/**", " * What the module exports; pointers and size_t are numbers.",
              " * @typedef {Object} Exports", " * @property {WebAssembly.Memory} memory"]
    lines += [f" * @property {{{kind}}} {name}" for name, kind in OWN_EXPORTS.items()]
    lines += [signature(name, text) for name, text in manifest["functions"].items()]
    return "\n".join(lines + [" */", ""])


def asserts(manifest):
    lines = ['#include "dcloth/dcloth_fit.h"', '#include "dcloth/dcloth_scene.h"',
             f"_Static_assert(sizeof(void*) == {POINTER_BYTES}, \"pointers\");"]
    for name, struct in manifest["structs"].items():
        placed, size = layout(struct["fields"], manifest["constants"])
        lines.append(f'_Static_assert(sizeof({name}) == {size}, "{name}");')
        for field, offset, bytes_, _ in placed:
            lines.append(f"_Static_assert(offsetof({name}, {field}) == {offset} && sizeof((({name}*)0)->{field}) == "
                         f'{bytes_}, "{name}.{field}");')
    lines += [f'_Static_assert({name} == {value}, "{name}");' for name, value in manifest["constants"].items()]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("manifest")
    parser.add_argument("--js")
    parser.add_argument("--exports")
    parser.add_argument("--asserts")
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    with open(options.manifest, encoding="utf-8") as file:
        manifest = json.load(file)
    if options.check:
        with open(options.js, encoding="utf-8") as file:
            if file.read() == javascript(manifest):
                print(f"{options.js}: {len(manifest['functions'])} functions, {len(manifest['structs'])} structs, "
                      f"{len(manifest['constants'])} constants as in {options.manifest}")
                return 0
        print(f"error: {options.js} is not made from {options.manifest} as it is now; mend: "
              f"platforms/web/generate_abi.py {options.manifest} --js {options.js}", file=sys.stderr)
        return 1
    exports = "".join(f"_{name}\n" for name in [*OWN_EXPORTS, *manifest["functions"]])
    for path, text in ((options.js, javascript(manifest)), (options.exports, exports),
                       (options.asserts, asserts(manifest))):
        if path:
            with open(path, "w", encoding="utf-8") as file:
                file.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
