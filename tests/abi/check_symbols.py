#!/usr/bin/env python3
"""Checks what static libraries ask of their host: nothing that allocates, aborts, throws, prints or runs before main.

Usage: check_symbols.py NM LIBRARY...
Allowed is a closed list; whatever else is undefined fails, so that a new dependency is a decision.
"""
import re
import subprocess
import sys

# Memory and text of the C library, square root and arc tangent.
ALLOWED = {"memcpy", "memmove", "memset", "memcmp", "memchr", "strncmp", "strlen", "sqrt", "sqrtf", "atan2"}
# The linker's own, and what sanitizers, hardening and position independence add; on Windows the compiler's touch of
# each page of a frame above 4 KB, where the system grows the stack page by page.
TOOLCHAIN = re.compile(r"_GLOBAL_OFFSET_TABLE_|__stack_chk_fail|___chkstk_ms|__(asan|ubsan|tsan|msan|sanitizer)_.*|"
                       r"__cpu_model|__cpu_indicator_init")
FORBIDDEN_DEFINITIONS = re.compile(r"_GLOBAL__sub_I_|__cxx_global_var_init")


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    listing = subprocess.run([sys.argv[1], "-g", "-a", *sys.argv[2:]], check=True, capture_output=True,
                             text=True).stdout
    objects, defined, undefined, initialisers = 0, set(), {}, []
    current = ""
    for line in listing.splitlines():
        if line.endswith(":"):
            objects += 1
            current = line[:-1]
            continue
        match = re.match(r"^[0-9a-fA-F ]*\s([A-Za-z])\s+(\S+)$", line)
        if not match:
            continue
        kind, name = match.groups()
        if kind in "Uw":
            undefined.setdefault(name, current)
        else:
            defined.add(name)
            if FORBIDDEN_DEFINITIONS.search(name):
                initialisers.append(f"{current}: {name}")
    outside = {name: where for name, where in undefined.items() if name not in defined}
    bad = {name: where for name, where in outside.items() if name not in ALLOWED and not TOOLCHAIN.fullmatch(name)}
    print(f"{', '.join(sys.argv[2:])}: {objects} objects, {len(defined)} symbols, asks for "
          f"{', '.join(sorted(outside)) or 'nothing'}")
    for name, where in sorted(bad.items()):
        print(f"error: {where} uses {name}, which is not on the list in {sys.argv[0]}", file=sys.stderr)
    for text in initialisers:
        print(f"error: static constructor in {text}", file=sys.stderr)
    if objects == 0 or not defined:
        print("error: no object or symbol was read; is this a static library?", file=sys.stderr)
        return 1
    return 1 if bad or initialisers else 0


if __name__ == "__main__":
    sys.exit(main())
