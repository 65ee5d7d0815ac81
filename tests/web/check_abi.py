#!/usr/bin/env python3
"""The kept abi.js is the one that generate_abi.py makes of the manifest, and a manifest changed anywhere makes another.

Usage: check_abi.py GENERATOR MANIFEST ABI_JS
"""
import copy
import importlib.util
import json
import subprocess
import sys
from pathlib import Path


def faults(manifest):
    """Changes of the manifest, one at a time."""
    def changed(change):
        copied = copy.deepcopy(manifest)
        change(copied)
        return copied

    for name, value in list(manifest["constants"].items())[::7]:
        yield f"{name} + 1", changed(lambda m: m["constants"].update({name: value + 1}))
    for name, struct in manifest["structs"].items():
        last = len(struct["fields"]) - 1
        yield f"{name}: a field fewer", changed(lambda m: m["structs"][name]["fields"].pop())
        yield f"{name}: fields turned round", changed(lambda m: m["structs"][name]["fields"].reverse())
        yield f"{name}: another type", changed(lambda m: m["structs"][name]["fields"][last].update(type="uint64_t[3]"))
    for name, text in list(manifest["functions"].items())[::5]:
        yield f"{name}: gone", changed(lambda m: m["functions"].pop(name))
        other = "uint32_t " if text.startswith("uint64_t ") else "uint64_t "
        result = other + text[text.index(name):]
        yield f"{name}: another result", changed(lambda m: m["functions"].update({name: result}))


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    generator, manifest, kept = sys.argv[1:]

    done = subprocess.run([sys.executable, generator, manifest, "--js", kept, "--check"], check=False)
    if done.returncode != 0:
        return 1
    spec = importlib.util.spec_from_file_location("generate_abi", generator)
    generate_abi = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(generate_abi)
    seeded, text = 0, Path(kept).read_text(encoding="utf-8")
    for what, changed in faults(json.loads(Path(manifest).read_text(encoding="utf-8"))):
        seeded += 1
        try:
            unseen = generate_abi.javascript(changed) == text
        except KeyError:  # a type that the generator does not know
            unseen = False
        if unseen:
            print(f"error: a seeded fault was not found: {what}", file=sys.stderr)
            return 1
    print(f"{seeded} seeded faults, all found")
    return 0 if seeded > 0 else 1


if __name__ == "__main__":
    sys.exit(main())
