#!/usr/bin/env python3
"""Checks the Unity package as the package manager reads it, or completes it.

Usage: check_package.py PACKAGE|TARBALL VERSION LICENCE [--write | --faults]

Files of an installed package are ignored unless a .meta file stands beside each, and references break when its GUID
changes: a .meta for every file and folder, none left over, each GUID once and made from the path. --write makes those
that are missing; --faults breaks copies of the package, which must be found. Assembly definitions name each other and
no more; package.json carries the library's VERSION; the licence goes with the package.
"""
import hashlib
import json
import re
import shutil
import sys
import tarfile
import tempfile
from pathlib import Path

PLAIN = "  externalObjects: {}\n  userData:\n  assetBundleName:\n  assetBundleVariant:\n"
IMPORTERS = {
    ".cs": "MonoImporter:\n  externalObjects: {}\n  serializedVersion: 2\n  defaultReferences: []\n"
           "  executionOrder: 0\n  icon: {instanceID: 0}\n  userData:\n  assetBundleName:\n  assetBundleVariant:\n",
    ".asmdef": "AssemblyDefinitionImporter:\n" + PLAIN,
    "package.json": "PackageManifestImporter:\n" + PLAIN,
    ".md": "TextScriptImporter:\n" + PLAIN,
    "folder": "folderAsset: yes\nDefaultImporter:\n" + PLAIN,
}
PLUGINS = {".so", ".dll", ".dylib", ".a"}


def guid(relative):
    return hashlib.md5(f"com.dcloth.unity/{relative}".encode()).hexdigest()


def meta(path, relative):
    kind = "folder" if path.is_dir() else path.name if path.name in IMPORTERS else path.suffix
    return f"fileFormatVersion: 2\nguid: {guid(relative)}\n{IMPORTERS.get(kind, '')}"


def hidden(relative):
    """What Unity does not import. Samples are copied into projects, with the .meta files below their folder."""
    hidden = any(p.startswith(".") for p in relative.parts)
    return hidden or (relative.parts[0].endswith("~") and len(relative.parts) < 3)


def check_metas(package, write):
    assets = [p for p in sorted(package.rglob("*")) if p.suffix != ".meta" and not hidden(p.relative_to(package))]
    seen, faults = {}, []
    for path in assets:
        beside = path.with_name(path.name + ".meta")
        relative = path.relative_to(package).as_posix()
        expected = meta(path, relative)
        if write and not beside.exists():
            beside.write_text(expected, encoding="utf-8")
        found = beside.read_text(encoding="utf-8") if beside.exists() else ""
        plugin = path.suffix in PLUGINS and found.startswith(expected + "PluginImporter:\n")
        if found != expected and not plugin:
            faults.append(f"{beside}: {'differs' if found else 'missing'}; delete it and run with --write")
        identity = re.search(r"^guid: ([0-9a-f]{32})$", found, re.MULTILINE)
        if identity and seen.setdefault(identity[1], path) != path:
            faults.append(f"{beside}: has the GUID of {seen[identity[1]]}")
    for path in package.rglob("*.meta"):
        if not path.with_suffix("").exists():
            faults.append(f"{path}: what it belongs to is gone")
    return len(assets), faults


def check_assemblies(package):
    """References of assembly definitions against what the sources of their folders use."""
    definitions = {p.parent: json.loads(p.read_text(encoding="utf-8")) for p in sorted(package.rglob("*.asmdef"))}
    names = {d["name"] for d in definitions.values()}
    for folder, definition in definitions.items():
        for reference in definition["references"]:
            if reference not in names:
                yield f"{folder}: references {reference}; known are {', '.join(sorted(names))}"
        sources = "".join(p.read_text(encoding="utf-8") for p in folder.glob("*.cs"))
        if not sources:
            yield f"{folder}: an assembly without sources"
        if definition["noEngineReferences"] and re.search(r"using Unity|\bUnity(Engine|Editor)\.", sources):
            yield f"{folder}: is free of the engine and names it"
        if "UnityEditor" in sources and definition["includePlatforms"] != ["Editor"]:
            yield f"{folder}: uses the editor and goes into players"
        if re.search(r"\bunsafe\b", sources) and not definition["allowUnsafeCode"]:
            yield f"{folder}: unsafe code is not allowed there"
    if len(definitions) < 4:
        yield f"{package}: {len(definitions)} assembly definitions; four were there"


def check_manifest(package, version, licence):
    manifest = json.loads((package / "package.json").read_text(encoding="utf-8"))
    if manifest["version"] != version:
        yield f"package.json: version {manifest['version']}, the library is {version}"
    for sample in manifest["samples"]:
        if not list((package / sample["path"]).glob("*.cs")):
            yield f"package.json: the sample {sample['path']} holds no source"
    if (package / "LICENSE.md").read_bytes() != Path(licence).read_bytes():
        yield f"LICENSE.md: differs from {licence}"


def faults_of(package, version, licence, write=False):
    count, faults = check_metas(package, write)
    faults += [*check_assemblies(package), *check_manifest(package, version, licence)]
    return faults + ([f"{package}: {count} assets only"] if count < 20 else []), count


# What is done to a copy: file, change of its text; None deletes it.
SEEDED = [
    ("Core/Native.cs.meta", None),
    ("Core/Native.cs", None),
    ("Core/Native.cs.meta", lambda text: text.replace(guid("Core/Native.cs"), guid("Core/ClothInstance.cs"))),
    ("Samples~/Skirt/SkirtSample.cs.meta", None),
    ("Runtime/DCloth.asmdef", lambda text: text.replace("DCloth.Core", "DCloth.Gone")),
    ("Runtime/DCloth.asmdef", lambda text: text.replace('"allowUnsafeCode": true', '"allowUnsafeCode": false')),
    ("Editor/DCloth.Editor.asmdef", lambda text: text.replace('["Editor"]', "[]")),
    ("Core/ClothInstance.cs", lambda text: "using UnityEngine;\n" + text),
    ("package.json", lambda text: text.replace('"version": "', '"version": "9')),
    ("package.json", lambda text: text.replace("Samples~/Skirt", "Samples~/Shirt")),
    ("LICENSE.md", lambda text: text + "and more"),
]


def check_seeded(package, version, licence):
    for name, change in SEEDED:
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "package"
            shutil.copytree(package, copy)
            before = (copy / name).read_text(encoding="utf-8")
            if change is None:
                (copy / name).unlink()
            else:
                assert change(before) != before, f"the change of {name} changes nothing"
                (copy / name).write_text(change(before), encoding="utf-8")
            faults, _ = faults_of(copy, version, licence)
            if not faults:
                yield f"a seeded fault in {name} was not found"
                continue
            print("seeded: " + faults[0].replace(str(copy), "package"))


def main():
    if len(sys.argv) < 4 or sys.argv[4:] not in ([], ["--write"], ["--faults"]):
        sys.exit(__doc__)
    package, (version, licence), options = Path(sys.argv[1]), sys.argv[2:4], sys.argv[4:]
    with tempfile.TemporaryDirectory() as folder:
        if package.is_file():
            with tarfile.open(package) as tar:
                tar.extractall(folder)
            package = Path(folder) / "package"
        faults, count = faults_of(package, version, licence, "--write" in options)
        if "--faults" in options and not faults:
            faults += check_seeded(package, version, licence)
    print(f"{sys.argv[1]}: {count} assets, {len(faults)} faults")
    for text in faults:
        print(f"error: {text}", file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
