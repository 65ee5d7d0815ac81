#!/usr/bin/env python3
"""Checks the C ABI against its manifest: every function with its signature, every struct with sizes and offsets, every
constant with its value, every symbol of the library. Every function's comment says Memory, Thread, Errors and Cost.

Usage: check_manifest.py MANIFEST CC --headers FOLDER... [--symbols NM LIBRARY...] [--write | --faults]

FOLDERs hold the public headers, every *.h: parsed for what they declare, compiled with CC as C99, each also alone, for
what that means in bytes. --write makes the manifest anew: a change of the ABI is then a change in its diff. --faults
seeds faults into copies of the headers, each of which must be found. Bindings in other languages are checked against
the same file. Offsets are those of 64-bit targets.
"""
import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

# Text of one of the headers, what replaces it. Each breaks a binding that was built before.
FAULTS = [
    ("  uint32_t column_major;         /*", "  uint64_t column_major;         /*"),
    ("  uint32_t joint_count;          /* dcloth_model_info", "  int32_t joint_count;          /* dcloth_model_info"),
    ("  uint32_t position_format;      /* DCLOTH_FORMAT_* */\n  uint32_t normal_format;        /* DCLOTH_FORMAT_* */\n",
     "  uint32_t normal_format;\n  uint32_t position_format;\n"),
    ("  float seconds;         /* since", "  float delta;         /* since"),
    ("  char text[240];", "  char text[248];"),
    ("  uint32_t struct_size;  /* set to sizeof(dcloth_frame) */\n", ""),
    ("DCLOTH_ERROR_POSE = 7", "DCLOTH_ERROR_POSE = 9"),
    ("  DCLOTH_STEP_STATIC,        /* pivot increments */\n", ""),
    ("#define DCLOTH_ALIGNMENT 64", "#define DCLOTH_ALIGNMENT 32"),
    ("  uint32_t padding;              /* never read */\n", ""),
    ("uint64_t elapsed[DCLOTH_TIMER_STEPS]", "uint64_t elapsed[DCLOTH_STEP_COUNT]"),
    ("DCLOTH_API dcloth_status dcloth_cloth_reset(dcloth_cloth* cloth);", ""),
    ("dcloth_cloth_skin(dcloth_cloth* cloth, const dcloth_pose* pose, float blend",
     "dcloth_cloth_skin(dcloth_cloth* cloth, const dcloth_pose* pose, double blend"),
    ('#include "dcloth/dcloth.h"\n\n#ifdef __cplusplus\nextern "C" {\n#endif\n\ntypedef struct dcloth_scene ',
     '#ifdef __cplusplus\nextern "C" {\n#endif\n\ntypedef struct dcloth_scene '),
    ("DCLOTH_API const char* dcloth_version(void);",
     "DCLOTH_API const char* dcloth_version(void);\nDCLOTH_API int32_t dcloth_more(void);"),
    ("  float spent_microseconds;   /*", "  double spent_microseconds;   /*"),
    ("  DCLOTH_LEVEL_SKELETON,\n", ""),
    ("dcloth_scene_set_importance(dcloth_scene* scene, uint32_t index, float importance);",
     "dcloth_scene_set_importance(dcloth_scene* scene, float importance, uint32_t index);"),
    (" Cost: clears the state. */", " */"),
]
CONTRACT = ["Memory:", "Thread:", "Errors:", "Cost:"]


def fold(text):
    return re.sub(r"\s*([*,()])\s*", lambda m: m.group(1) + (" " if m.group(1) in "*," else ""),
                  " ".join(text.split())).replace("* *", "**").replace("* )", "*)").strip()


def field(declaration):
    """(type, name) of a struct's field; arrays and function pointers keep their shape in the type."""
    pointer = re.fullmatch(r"(.+?)\(\s*\*\s*(\w+)\s*\)\s*\((.*)\)", declaration, re.DOTALL)
    if pointer:
        return fold(f"{pointer[1]} (*)({pointer[3]})"), pointer[2]
    array = re.fullmatch(r"(.+?)\s*(\w+)\s*(\[[^\]]*\])", declaration, re.DOTALL)
    if array:
        return fold(array[1]) + array[3], array[2]
    plain = re.fullmatch(r"(.+?)(\w+)", declaration, re.DOTALL)
    return fold(plain[1]), plain[2]


def parse(headers):
    text = re.sub(r"/\*.*?\*/", " ", "\n".join(headers.values()), flags=re.DOTALL)
    macros = re.findall(r"^#define (DCLOTH_\w+) +\d+$", re.sub(r"[ \t]+$", "", text, flags=re.MULTILINE), re.MULTILINE)
    structs = {}
    for name, body in re.findall(r"typedef struct (\w+) \{(.*?)\}", text, re.DOTALL):
        structs[name] = [field(d.strip()) for d in body.split(";") if d.strip()]
    constants = []
    for body in re.findall(r"\benum \{(.*?)\}", text, re.DOTALL):
        constants += [e.split("=")[0].strip() for e in body.split(",") if e.strip()]
    functions = {}
    for declaration in re.findall(r"^DCLOTH_API\s+(.*?);", text, re.DOTALL | re.MULTILINE):
        functions[re.search(r"(\w+)\s*\(", declaration)[1]] = fold(declaration)
    return macros + constants, structs, functions


def write_headers(headers, folder):
    include = Path(folder) / "dcloth"
    include.mkdir()
    for name, text in headers.items():
        (include / name).write_text(text, encoding="utf-8")


def measure(headers, names, structs, cc):
    """Bytes and values, by a program that includes the headers."""
    includes = [f'#include "dcloth/{name}"' for name in headers]
    lines = [*includes, "#include <stdio.h>", "int main(void) {"]
    lines += [f'  printf("c {n} %lld\\n", (long long)({n}));' for n in names]
    for struct, fields in structs.items():
        lines.append(f'  printf("s {struct} %zu\\n", sizeof({struct}));')
        for _, name in fields:
            lines.append(f'  printf("f {struct}.{name} %zu %zu\\n", offsetof({struct}, {name}), '
                         f"sizeof((({struct}*)0)->{name}));")
    lines += ['  printf("p pointer %zu\\n", sizeof(void*));', "  return 0;", "}"]
    with tempfile.TemporaryDirectory() as folder:
        write_headers(headers, folder)
        source, program = Path(folder) / "measure.c", Path(folder) / "measure"
        source.write_text("\n".join(lines) + "\n", encoding="utf-8")
        subprocess.run([cc, "-std=c99", "-I", folder, source, "-o", program], check=True)
        printed = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    return {line.split()[1]: [int(x) for x in line.split()[2:]] for line in printed.splitlines()}


def alone_faults(headers, cc):
    """Headers that are not valid C99 when nothing is included before them."""
    with tempfile.TemporaryDirectory() as folder:
        write_headers(headers, folder)
        for name in headers:
            done = subprocess.run([cc, "-std=c99", "-Wall", "-Wpedantic", "-Wstrict-prototypes", "-Werror",
                                   "-fsyntax-only",
                                   "-x", "c", "-I", folder, "-"], input=f'#include "dcloth/{name}"\nint main(void);\n',
                                  capture_output=True, text=True, check=False)
            if done.returncode != 0:
                errors = [line for line in done.stderr.splitlines() if "error:" in line]
                yield f"{name}: no C99 of its own: {(errors or [done.stderr])[0]}"


def describe(headers, cc):
    names, structs, functions = parse(headers)
    found = measure(headers, names, structs, cc)
    return {
        "pointer_bytes": found["pointer"][0],
        "functions": dict(sorted(functions.items())),
        "structs": {
            struct: {
                "bytes": found[struct][0],
                "fields": [{"name": name, "type": kind, "offset": found[f"{struct}.{name}"][0],
                            "bytes": found[f"{struct}.{name}"][1]} for kind, name in fields],
            } for struct, fields in sorted(structs.items())
        },
        "constants": {name: found[name][0] for name in names},
    }


def differences(expected, found, path=""):
    if isinstance(expected, dict) and isinstance(found, dict):
        lines = []
        for key in sorted(set(expected) | set(found)):
            where = f"{path}.{key}" if path else key
            if key not in expected:
                lines.append(f"{where}: not in the manifest")
            elif key not in found:
                lines.append(f"{where}: gone")
            else:
                lines += differences(expected[key], found[key], where)
        return lines
    if isinstance(expected, list) and isinstance(found, list) and len(expected) == len(found):
        return [line for i, (a, b) in enumerate(zip(expected, found)) for line in differences(a, b, f"{path}[{i}]")]
    return [] if expected == found else [f"{path}: manifest says {expected!r}, the headers {found!r}"]


def rules(found):
    """What holds for every struct, whatever the manifest says."""
    for name, struct in found["structs"].items():
        first = struct["fields"][0]
        if (first["name"], first["type"], first["offset"]) != ("struct_size", "uint32_t", 0):
            yield f"structs.{name}: does not start with uint32_t struct_size"
        last = struct["fields"][-1]
        if last["offset"] + last["bytes"] != struct["bytes"]:
            yield (f"structs.{name}: padding behind the last field; a later field there would be read from old hosts' "
                   "garbage")
        for member in struct["fields"]:
            if re.search(r"\[\w*_COUNT\]$", member["type"]):
                yield f"structs.{name}.{member['name']}: an array as long as an enum, which may grow"


def contract_faults(headers):
    """A block up to an empty line is one comment and the functions that it is about."""
    for block in "\n\n".join(headers.values()).split("\n\n"):
        lacks = [word for word in CONTRACT if word not in block]
        for name in re.findall(r"^DCLOTH_API [^(]*?(\w+)\(", block, re.MULTILINE) if lacks else []:
            yield f"{name}: its comment lacks {', '.join(lacks)}"


def symbol_faults(functions, nm, *libraries):
    listing = subprocess.run([nm, "-g", *libraries], check=True, capture_output=True, text=True).stdout
    defined = set(re.findall(r"^[0-9a-fA-F]+ [TDRBV] (dcloth_\w+)$", listing, re.MULTILINE))
    return ([f"{name}: declared, in no library" for name in sorted(set(functions) - defined)] +
            [f"{name}: in a library, not declared" for name in sorted(defined - set(functions))])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("manifest", type=Path)
    parser.add_argument("cc")
    parser.add_argument("--headers", nargs="+", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--symbols", nargs="+", metavar=("NM", "LIBRARY"))
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--faults", action="store_true")
    options = parser.parse_args()
    paths = sorted((path for folder in options.headers for path in folder.glob("*.h")), key=lambda path: path.name)
    headers = {path.name: path.read_text(encoding="utf-8") for path in paths}
    found = describe(headers, options.cc)
    if options.write:
        options.manifest.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    expected = json.loads(options.manifest.read_text(encoding="utf-8"))
    faults = [*differences(expected, found), *rules(found), *contract_faults(headers),
              *alone_faults(headers, options.cc)]
    if options.symbols:
        faults += symbol_faults(found["functions"], *options.symbols)
    counts = {key: len(found[key]) for key in ("functions", "structs", "constants")}
    print(f"{', '.join(headers)}: " + ", ".join(f"{n} {key}" for key, n in counts.items()))
    if min(counts.values()) == 0:
        faults.append("nothing was parsed")
    for line in faults:
        print(f"error: {line}", file=sys.stderr)
    if faults:
        print("error: an intended change of the ABI is recorded with --write", file=sys.stderr)
        return 1
    if options.faults:
        for before, after in FAULTS:
            if sum(text.count(before) for text in headers.values()) != 1:
                print(f"error: the fault {before!r} no longer fits the headers once", file=sys.stderr)
                return 1
            changed = {name: text.replace(before, after) for name, text in headers.items()}
            seeded = describe(changed, options.cc)
            lines = [*differences(expected, seeded), *rules(seeded), *contract_faults(changed),
                     *alone_faults(changed, options.cc)]
            print(f"seeded: {lines[0] if lines else 'NOT FOUND: ' + before!r}")
            if not lines:
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
