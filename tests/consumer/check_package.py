#!/usr/bin/env python3
"""Builds a host in C99 against the package in each way a game may take it, and runs it.

Usage: check_package.py WAY BUILD_FOLDER MODEL WORK_FOLDER [CMAKE_OPTION...]

WAY: find_package, pkg_config (of what `cmake --install BUILD_FOLDER` installs, moved afterwards) or add_subdirectory
(of the repository, as a shared library, unoptimised: it is built for this test alone). The host is
tests/abi/consumer.c; it plays MODEL. PKG_CONFIG and CC name other programs than pkg-config and cc.
"""
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
HOST = ROOT / "tests/abi/consumer.c"
WARNINGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wstrict-prototypes", "-Werror"]


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False, **options)
    if done.returncode != 0:
        sys.exit(f"error: {shlex.join(map(str, command))} returned {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout


def play(program, model, **options):
    said = run(program, model, **options)
    if "60 frames: fine" not in said:
        sys.exit(f"error: {program} did not play {model} to its end, it says: {said!r}")
    print(f"{program}: {said.strip()}")


def build(project, folder, *options):
    run("cmake", "-S", HERE / project, "-B", folder, "-G", "Ninja", f"-DCONSUMER={HOST}", *options)
    run("cmake", "--build", folder, "--parallel", 2)
    return folder / "game"


def install(build_folder, work):
    """Installs and moves what was installed: nothing in it may remember where it was."""
    run("cmake", "--install", build_folder, "--prefix", work / "installed")
    moved = work / "elsewhere" / "dcloth"
    moved.parent.mkdir()
    return (work / "installed").rename(moved)


def check_pkg_config(prefix, work, model):
    files = list(prefix.rglob("dcloth.pc"))
    if len(files) != 1:
        sys.exit(f"error: {len(files)} files dcloth.pc under {prefix}, one is expected")
    environment = {**os.environ, "PKG_CONFIG_PATH": str(files[0].parent)}
    tool = os.environ.get("PKG_CONFIG", "pkg-config")

    def ask(*what):
        return shlex.split(run(tool, *what, "dcloth_fit", env=environment))

    version = ask("--modversion")[0]
    program = work / "game"
    run(os.environ.get("CC", "cc"), *WARNINGS, HOST, "-o", program, *ask("--cflags", "--libs"), "-lm")
    libraries = [flag[2:] for flag in ask("--libs-only-L")]
    play(program, model, env={**os.environ, "LD_LIBRARY_PATH": ":".join(libraries)})
    check_sketch(work, ask("--cflags"))
    check_page(work, ask("--cflags", "--libs"), model, {**os.environ, "LD_LIBRARY_PATH": ":".join(libraries)})
    if f"dcloth {version} " not in run(program, model, env={**os.environ, "LD_LIBRARY_PATH": ":".join(libraries)}):
        sys.exit(f"error: pkg-config says version {version}, the library another one")


def program_of(page, begins=""):
    """The one block of C on a page that begins so."""
    blocks = re.findall(r"^```c\n(.*?)^```$", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    blocks = [block for block in blocks if block.startswith(begins)]
    if len(blocks) != 1:
        sys.exit(f"error: {len(blocks)} programs in C on {page}, one is expected")
    return blocks[0]


def check_sketch(work, flags):
    """The lines in C that README.md shows, with what they leave to the host as parameters."""
    host = ("int host(const void* bytes, size_t size, void* view, void* memory, uint32_t joint_count, uint32_t "
            "vertex_count,\n         const float* joint_matrices, float* positions, float* normals, float "
            "delta_seconds)")
    source = work / "sketch.c"
    source.write_text(f"#include <dcloth/dcloth.h>\n\nint fail(const char* text);\n\n{host};\n{host} {{\n"
                      f"{program_of('README.md')}return 0;\n}}\n", encoding="utf-8")
    run(os.environ.get("CC", "cc"), *WARNINGS, "-c", source, "-o", work / "sketch.o", *flags)


def check_page(work, flags, model, environment):
    """The host that docs/integrate.md shows, as it stands there."""
    source, program = work / "game.c", work / "page"
    source.write_text(program_of("docs/integrate.md", "#include"), encoding="utf-8")
    run(os.environ.get("CC", "cc"), *WARNINGS, source, "-o", program, *flags)
    said = run(program, model, env=environment)
    if not re.fullmatch(r".+ on \w+: \d+ vertices, the first at( -?\d+\.\d{3}){3}\n", said):
        sys.exit(f"error: the host of docs/integrate.md says {said!r}")
    print(f"docs/integrate.md: {said.strip()}")


def main():
    if len(sys.argv) < 5:
        sys.exit(__doc__)
    way, build_folder, model, work = sys.argv[1], *map(Path, sys.argv[2:5])
    options = sys.argv[5:]
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    if way == "add_subdirectory":
        play(build(way, work / "build", f"-DDCLOTH={ROOT}", "-DBUILD_SHARED_LIBS=ON", "-DCMAKE_BUILD_TYPE=Debug",
                   *options), model)
    elif way == "find_package":
        play(build(way, work / "build", f"-DCMAKE_PREFIX_PATH={install(build_folder, work)}"), model)
    elif way == "pkg_config":
        check_pkg_config(install(build_folder, work), work, model)
    else:
        sys.exit(f"check_package: unknown way '{way}'; allowed: find_package, pkg_config, add_subdirectory")


if __name__ == "__main__":
    main()
