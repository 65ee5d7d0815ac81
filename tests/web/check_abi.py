#!/usr/bin/env python3
"""The kept abi.js is the one that generate_abi.py makes of the manifest, and a manifest changed anywhere makes another.

Usage: check_abi.py GENERATOR MANIFEST ABI_JS
"""
import copy
import json
import subprocess
import sys
import tempfile
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
        yield f"{name}: another result", changed(
            lambda m: m["functions"].update({name: "uint64_t " + text[text.index(name):]}))


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    generator, manifest, kept = sys.argv[1:]

    def check(path):
        return subprocess.run([sys.executable, generator, path, "--js", kept, "--check"], capture_output=True,
                              text=True)

    done = check(manifest)
    print(done.stdout + done.stderr, end="")
    if done.returncode != 0:
        return 1
    seeded = 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "abi.json"
        for what, changed in faults(json.loads(Path(manifest).read_text(encoding="utf-8"))):
            path.write_text(json.dumps(changed), encoding="utf-8")
            seeded += 1
            if check(path).returncode == 0:
                print(f"error: a seeded fault was not found: {what}", file=sys.stderr)
                return 1
    print(f"{seeded} seeded faults, all found")
    return 0 if seeded > 0 else 1


if __name__ == "__main__":
    sys.exit(main())
