"""Animations and characters through the `dcloth` command, which reads glTF, FBX and BVH."""
import json
import os
import shutil
import subprocess

from .errors import TruthError, refuse


def find_command(given=None):
    here = os.path.join(os.path.dirname(__file__), "..", "..", "..", "build", "dcloth")
    for path in (given, os.environ.get("DCLOTH_BIN"), here, shutil.which("dcloth")):
        if path and os.access(path, os.X_OK):
            return os.path.abspath(path)
    refuse("dcloth", "no such command", "the built command line",
           "build it (docs/train_your_own.md) or give --dcloth PATH")


def _run(*arguments):
    result = subprocess.run([str(a) for a in arguments], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise TruthError(result.stderr.strip().replace("dcloth: error: ", "") or f"{arguments[0]} failed")
    return result.stderr.strip()


def _options(**values):
    out = []
    for key, value in values.items():
        for one in value if isinstance(value, (list, tuple)) else [value]:
            out += [] if one is None else [f"--{key}", one]
    return out


def _map(project, folder):
    if not isinstance(project.get("map"), dict):
        return project.get("map")
    path = os.path.join(folder, "map.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump(project["map"], file)
    return path


def body(command, project, folder):
    """The character's body as a safetensors file; as it is where the project names such a file."""
    if project["character"].endswith(".safetensors"):
        return project["character"]
    out = os.path.join(folder, "body.safetensors")
    _run(command, "body", project["character"], "-o", out, *_options(
        map=_map(project, folder), mesh=project.get("body_meshes"), unit=project.get("character_unit"),
        up=project.get("character_up")))
    return out


def poses(command, project, clip, character, rate, folder):
    """A sequence file of the clip's animation in the character's joints; as it is where the clip names one."""
    if clip["animation"].endswith(".safetensors"):
        return clip["animation"]
    out = os.path.join(folder, "poses.safetensors")
    _run(command, "poses", clip["animation"], "-o", out, "--model", character, "--fps", rate, *_options(
        map=_map(project, folder), clip=clip.get("animation_clip"), unit=clip.get("animation_unit"),
        up=clip.get("animation_up")))
    return out
