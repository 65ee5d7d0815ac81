#!/usr/bin/env python3
"""Unpacks the plugin that scripts/package_unreal.py packs and builds it as far as it goes without Unreal: every source
is compiled with the packed headers alone and linked with the packed library. With Mono, its .Build.cs files are
compiled and run too.

Usage: check_package.py PACKER LIBRARY STAND_IN_INCLUDES REPOSITORY COMPILER FOLDER [MCS MONO]
"""
import json
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command[0]}: {done.stdout}{done.stderr}"
    return done.stdout


def main():
    packer, library, includes, repository, compiler, folder, *mono = sys.argv[1:]
    folder = Path(folder)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in ("once.zip", "twice.zip"):
        run(sys.executable, packer, folder / name, f"Linux={library}")
    assert (folder / "once.zip").read_bytes() == (folder / "twice.zip").read_bytes(), "two packs differ"
    refused = subprocess.run([sys.executable, packer, folder / "bad.zip", f"PlayStation={library}"], check=False,
                             capture_output=True, text=True)
    assert refused.returncode != 0 and "allowed: Linux" in refused.stderr and not (folder / "bad.zip").exists()
    with zipfile.ZipFile(folder / "once.zip") as zipped:
        zipped.extractall(folder)

    plugin = folder / "DCloth"
    description = json.loads((plugin / "DCloth.uplugin").read_text())
    modules = [module["Name"] for module in description["Modules"]]
    assert modules and all((plugin / f"Source/{name}/{name}.Build.cs").is_file() for name in modules), modules
    sources = sorted((plugin / "Source").glob("*/Private/*.cpp"))
    assert len(sources) > len(modules)
    third_party = plugin / "Source/ThirdParty/dcloth"
    folders = [includes, third_party / "include", *(plugin / "Source").glob("*/P[ur]*")]
    # The stand-in is named from the repository; nothing else may come from there.
    stand_in = folder / "stand_in/tests/unreal/stand_in"
    shutil.copytree(Path(repository) / "tests/unreal/stand_in", stand_in)
    run(compiler, "-std=c++20", "-O0", "-fPIC", "-shared", "-fno-exceptions", "-Wall", "-Wextra", "-Werror",
        f"-I{folder / 'stand_in'}", *(f"-I{path}" for path in folders), *sources, third_party / "lib/Linux/libdcloth.a",
        "-Wl,-z,defs", "-o", folder / "plugin.so")
    print(f"{len(sources)} sources of {len(modules)} modules compiled and linked")

    if mono:
        mcs, mono = mono
        program = folder / "build_rules.exe"
        run(mcs, "-warnaserror", f"-out:{program}", stand_in / "unreal_build_tool.cs",
            *(plugin / f"Source/{name}/{name}.Build.cs" for name in modules))
        print(run(mono, program, plugin), end="")


if __name__ == "__main__":
    main()
