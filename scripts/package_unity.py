#!/usr/bin/env python3
"""Packs the Unity package with native libraries into one file for Unity's package manager ("Add package from tarball").

Usage: package_unity.py OUT.tgz [notices=TEXT.md] PLATFORM=LIBRARY...

PLATFORM is one of linux, windows, macos, android, ios, webgl; LIBRARY the shared library, or the static one for ios and
webgl, built for that platform (platforms/unity/README.md). Links are followed. TEXT.md: licences of what the libraries
contain.
"""
import gzip
import hashlib
import io
import sys
import tarfile
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "platforms/unity"
# Name in the package, platform and processor in Unity's words, system of the editor that loads it too.
PLATFORMS = {
    "linux": ("libdcloth.so", "Standalone: Linux64", "x86_64", "Linux"),
    "windows": ("dcloth.dll", "Standalone: Win64", "x86_64", "Windows"),
    "macos": ("libdcloth.dylib", "Standalone: OSXUniversal", "AnyCPU", "OSX"),
    "android": ("libdcloth.so", "Android: Android", "ARM64", None),
    "ios": ("libdcloth.a", "iPhone: iOS", "AnyCPU", None),
    "webgl": ("libdcloth.a", "WebGL: WebGL", "AnyCPU", None),
}


def importer(platform):
    """A .meta file's part on where a plugin goes: that platform, the editor on it, nowhere else."""
    _, target, cpu, editor = PLATFORMS[platform]
    parts = [("Any", ": Any", 0, {}), ("Editor", "Editor: Editor", int(editor is not None),
                                       {"CPU": "x86_64" if cpu == "x86_64" else "AnyCPU", "OS": editor or "AnyOS"}),
             ("target", target, 1, {"CPU": cpu})]
    text = ("PluginImporter:\n  externalObjects: {}\n  serializedVersion: 2\n  iconMap: {}\n  executionOrder: {}\n"
            "  defineConstraints: []\n  isPreloaded: 0\n  isOverridable: 1\n  isExplicitlyReferenced: 0\n"
            "  validateReferences: 1\n  platformData:\n")
    for _, first, enabled, settings in parts:
        text += f"  - first:\n      {first}\n    second:\n      enabled: {enabled}\n      settings:"
        text += "".join(f"\n        {key}: {value}" for key, value in settings.items()) if settings else " {}"
        text += "\n"
    return text + "  userData:\n  assetBundleName:\n  assetBundleVariant:\n"


def meta(relative, body):
    guid = hashlib.md5(f"com.dcloth.unity/{relative}".encode()).hexdigest()
    return f"fileFormatVersion: 2\nguid: {guid}\n{body}".encode()


def entries(plugins, notices):
    """(path in the package, bytes) of everything."""
    for path in sorted(PACKAGE.rglob("*")):
        if path.is_file():
            yield path.relative_to(PACKAGE).as_posix(), path.read_bytes()
    folder = ("folderAsset: yes\nDefaultImporter:\n  externalObjects: {}\n  userData:\n  assetBundleName:\n"
              "  assetBundleVariant:\n")
    if notices is not None:
        name = "Third Party Notices.md"
        yield name, notices.read_bytes()
        yield name + ".meta", meta(name, "TextScriptImporter:\n" + folder.split("DefaultImporter:\n")[1])
    yield "Plugins.meta", meta("Plugins", folder)
    for platform, library in plugins.items():
        name = f"Plugins/{platform}/{PLATFORMS[platform][0]}"
        yield f"Plugins/{platform}.meta", meta(f"Plugins/{platform}", folder)
        yield name, library.read_bytes()
        yield name + ".meta", meta(name, importer(platform))


def main():
    if len(sys.argv) < 3 or "=" in sys.argv[1]:
        sys.exit(__doc__)
    plugins, notices = {}, None
    for argument in sys.argv[2:]:
        platform, _, library = argument.partition("=")
        if platform == "notices" and Path(library).is_file():
            notices = Path(library)
            continue
        if platform not in PLATFORMS:
            sys.exit(f"package_unity: unknown platform '{platform}'; allowed: {', '.join(PLATFORMS)}")
        if not Path(library).is_file():
            sys.exit(f"package_unity: no library at '{library}' for {platform}; build it first")
        plugins[platform] = Path(library)
    packed = io.BytesIO()
    # No times, owners or modes of this machine: the same content is the same file.
    with gzip.GzipFile(fileobj=packed, mode="wb", mtime=0) as zipped, tarfile.open(fileobj=zipped, mode="w") as tar:
        for name, data in entries(plugins, notices):
            info = tarfile.TarInfo(f"package/{name}")
            info.size = len(data)
            tar.addfile(info, io.BytesIO(data))
    out = Path(sys.argv[1])
    part = out.with_name(out.name + ".part")
    part.write_bytes(packed.getvalue())
    part.replace(out)
    print(f"{out}: {out.stat().st_size} bytes, plugins for {', '.join(plugins)}")


if __name__ == "__main__":
    main()
