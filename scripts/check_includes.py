#!/usr/bin/env python3
"""Checks who includes whom: fit -> engine -> {format view, kernels}, and who may see which library.

Usage: check_includes.py REPOSITORY
"""
import re
import sys
from pathlib import Path

SOURCES = {".c", ".cc", ".h", ".hpp"}
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)

FLATBUFFERS = re.compile(r"flatbuffers/|dcloth_generated\.h|dcloth_objects\.h")
EIGEN = re.compile(r"Eigen/|unsupported/Eigen")
HIGHWAY = re.compile(r"hwy/")
EXCEPTIONS_AND_HEAP = re.compile(r"vector|string|memory|map|set|unordered_\w+|iostream|fstream|sstream|stdexcept|"
                                 r"thread|mutex|chrono|cstdlib|stdlib\.h|cstdio|stdio\.h|cassert|assert\.h")
# What the engine may know of the model file: the view, what fills it, what tells of a fault.
FORMAT_FOR_ENGINE = {"engine/format/view.h", "engine/format/verify.h", "engine/format/diagnostic.h",
                     "engine/format/limits.h", "engine/format/checksum.h", "engine/format/tick_parts.h",
                     "engine/format/fit_file.h", "engine/format/scan.h"}
PACKING = re.compile(r"kernels/(half|kernels|kernel_list|scalar_math)\.h|kernels/\w+/\w+(?<!-inl)\.h")
ROOMS = ("engine/", "fit/", "kernels/", "converter/", "tools/", "platforms/", "tests/", "bench/")
# The rooms of engine/src, each with those that it may see; "" is what lies in no room, the cloth that is made of them.
ENGINE_ROOMS = {
    "base": set(),
    "pose": {"base"},
    "network": {"base", "pose", "time", ""},
    "time": {"base", "pose", "network", ""},
    "draw": {"base", "pose"},
    "contact": {"base", "pose", "draw"},
    "": {"base", "pose", "network", "time", "draw", "contact"},
    "state": {"base", "pose", "network", "time", ""},
    "scene": {"base", "network", "time", ""},
    "api": {"base", "pose", "network", "time", "draw", "contact", "state", "scene", ""},
}
ENGINE_FILE = re.compile(r"engine/src/(?:(\w+)/)?\w+\.(?:h|cc)")


def room(name, *rooms):
    return any(name.startswith(r) for r in rooms)


def engine_room(path):
    """The room of a file of the engine: "" for one in none, None for other files."""
    match = ENGINE_FILE.fullmatch(path)
    return match and (match.group(1) or "")


def engine_fault(path, name):
    """Why a file of one room of the engine may not include one of another, or None."""
    here, there = engine_room(path), engine_room(name)
    if here is None or there is None:
        return None
    for unknown in {here, there} - set(ENGINE_ROOMS):
        return f"ENGINE_ROOMS in check_includes.py does not say what the room {unknown!r} sees"
    if here != there and there not in ENGINE_ROOMS[here]:
        return f"the room {here!r} of the engine sees only " + ", ".join(sorted(filter(None, ENGINE_ROOMS[here])))
    return None


def fault(path, name):
    """Why `path` may not include `name`, or None."""
    if room(path, "tests/", "bench/"):
        return None
    if FLATBUFFERS.match(name) and not (path == "engine/format/schema.h" or path.startswith("converter/")):
        return "only engine/format/schema.h and the converter include FlatBuffers"
    if name == "engine/format/schema.h" and not room(path, "engine/format/"):
        return "the generated schema code stays inside engine/format"
    if EIGEN.match(name) and not room(path, "converter/", "tools/"):
        return "Eigen lives in converter, tests and bench"
    if HIGHWAY.match(name) and not room(path, "kernels/"):
        return "Highway lives in kernels"
    if room(path, "kernels/"):
        if room(name, *(r for r in ROOMS if r != "kernels/")) or name.startswith("dcloth/"):
            return "kernels know nothing above them"
        if EXCEPTIONS_AND_HEAP.fullmatch(name):
            return "kernels never see containers, the heap or input and output"
    if room(path, "engine/include/", "fit/include/"):
        if room(name, *ROOMS):
            return "the public headers stand alone"
    if room(path, "engine/", "fit/"):
        if EXCEPTIONS_AND_HEAP.fullmatch(name):
            return "the runtime neither allocates nor prints nor throws"
        if room(name, "converter/", "tools/", "platforms/", "tests/", "bench/"):
            return "the runtime knows nothing of the offline side"
    if room(path, "engine/") and (room(name, "fit/") or name == "dcloth/dcloth_fit.h"):
        return "the core knows nothing of the fit"
    if room(path, "engine/format/") and room(name, "engine/src/"):
        return "the format knows nothing of the engine"
    if room(path, "engine/src/", "fit/") and name.startswith("engine/format/") and name not in FORMAT_FOR_ENGINE:
        return "the engine sees of the format only " + ", ".join(sorted(FORMAT_FOR_ENGINE))
    if engine_fault(path, name):
        return engine_fault(path, name)
    if room(path, "converter/") and (room(name, "engine/src/", "fit/", "tools/", "tests/", "bench/") or
                                     (name.startswith("kernels/") and not PACKING.fullmatch(name))):
        return "the converter sees the format, the public header, and the kernels' packing and references"
    if room(path, "tools/") and room(name, "engine/", "fit/", "kernels/", "tests/", "bench/"):
        return "tools see the converter and the public header"
    if room(path, "platforms/") and room(name, *(r for r in ROOMS if r != "platforms/")):
        return "platforms see the public header only"
    return None


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    root = Path(sys.argv[1])
    files, includes, faults = 0, 0, []
    for top in ROOMS:
        for path in sorted((root / top).rglob("*")):
            if path.suffix not in SOURCES or not path.is_file():
                continue
            files += 1
            text = path.read_text(encoding="utf-8")
            relative = path.relative_to(root).as_posix()
            for match in INCLUDE.finditer(text):
                includes += 1
                reason = fault(relative, match.group(1))
                if reason:
                    line = text.count("\n", 0, match.start(1)) + 1
                    faults.append(f"{relative}:{line}: includes {match.group(1)}: {reason}")
    print(f"{files} files, {includes} includes, {len(faults)} against the rules")
    for text in faults:
        print(f"error: {text}", file=sys.stderr)
    if files == 0 or includes == 0:
        print(f"error: no source file found under {root}", file=sys.stderr)
        return 1
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
