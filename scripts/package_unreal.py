#!/usr/bin/env python3
"""Packs the Unreal plugin with static libraries into a zip to unpack into a project's folder Plugins.

Usage: package_unreal.py OUT.zip [notices=TEXT.md] PLATFORM=LIBRARY...

PLATFORM is one of Linux, LinuxArm64, Win64, Mac, Android, IOS; LIBRARY the static library that was built for that
platform (platforms/unreal/README.md). Links are followed. TEXT.md: licences of what the libraries contain.
"""
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLUGIN = ROOT / "platforms/unreal/DCloth"
THIRD_PARTY = "Source/ThirdParty/dcloth"
PLATFORMS = {name: "dcloth.lib" if name == "Win64" else "libdcloth.a"
             for name in ("Linux", "LinuxArm64", "Win64", "Mac", "Android", "IOS")}


def entries(libraries, notices):
    """(path in the plugin, file) of everything."""
    for path in sorted(PLUGIN.rglob("*")):
        if path.is_file():
            yield path.relative_to(PLUGIN).as_posix(), path
    yield "README.md", ROOT / "platforms/unreal/README.md"
    yield "LICENSE", ROOT / "LICENSE"
    if notices is not None:
        yield "Third Party Notices.md", notices
    for path in sorted((ROOT / "engine/include/dcloth").glob("*.h")):
        yield f"{THIRD_PARTY}/include/dcloth/{path.name}", path
    for name in ("garment.h", "garment.cc"):
        yield f"{THIRD_PARTY}/include/garment/{name}", ROOT / "platforms/garment" / name
    for platform, library in libraries.items():
        yield f"{THIRD_PARTY}/lib/{platform}/{PLATFORMS[platform]}", library


def main():
    if len(sys.argv) < 3 or "=" in sys.argv[1]:
        sys.exit(__doc__)
    libraries, notices = {}, None
    for argument in sys.argv[2:]:
        platform, _, library = argument.partition("=")
        if platform != "notices" and platform not in PLATFORMS:
            sys.exit(f"package_unreal: unknown platform '{platform}'; allowed: {', '.join(PLATFORMS)}")
        if not Path(library).is_file():
            sys.exit(f"package_unreal: no file at '{library}' for {platform}; build it first")
        if platform == "notices":
            notices = Path(library)
        else:
            libraries[platform] = Path(library)
    out = Path(sys.argv[1])
    part = out.with_name(out.name + ".part")
    with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as zipped:
        for name, path in entries(libraries, notices):
            # No times or modes of this machine: the same content is the same file.
            info = zipfile.ZipInfo(f"DCloth/{name}", (1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            zipped.writestr(info, path.read_bytes())
    part.replace(out)
    print(f"{out}: {out.stat().st_size} bytes, libraries for {', '.join(libraries)}")


if __name__ == "__main__":
    main()
