"""The project file of an import: JSON, every key known, paths beside it."""
import json
import os

from .errors import refuse

KEYS = {
    "project": {"character", "character_unit", "character_up", "body_meshes", "map", "garment", "garment_unit",
                "garment_up", "hips", "feature_joints", "defaults", "clips"},
    "clip": {"name", "kind", "animation", "animation_unit", "animation_up", "animation_clip", "cache", "mesh", "unit",
             "up", "fps", "offset_seconds", "interpolate"},
}
TEXTS = {"character", "character_unit", "character_up", "garment", "garment_unit", "garment_up", "hips", "name", "kind",
         "animation", "animation_unit", "animation_up", "animation_clip", "cache", "mesh", "unit", "up"}


def _check(path, what, value, required):
    if not isinstance(value, dict):
        refuse(path, f"{what} that is {type(value).__name__}", "an object")
    allowed = KEYS["project" if what == "project" else "clip"]
    unknown = sorted(set(value) - allowed)
    if unknown:
        refuse(path, f"'{unknown[0]}' in {what}", f"one of {', '.join(sorted(allowed))}")
    missing = sorted(required - set(value))
    if missing:
        refuse(path, f"{what} without '{missing[0]}'", f"all of {', '.join(sorted(required))}")
    for key in TEXTS & set(value):
        if key.endswith("unit") and isinstance(value[key], (int, float)) and not isinstance(value[key], bool):
            continue
        if not isinstance(value[key], str) or not value[key]:
            refuse(path, f"{key} {value[key]!r} in {what}", "a text")


def _number(path, clip, key, low, high):
    value = clip.get(key)
    if value is None:
        return
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        refuse(path, f"{key} {value!r} of clip '{clip['name']}'", f"a number from {low:g} to {high:g}")


def read(path):
    """The project with defaults filled in and paths absolute."""
    try:
        with open(path, encoding="utf-8") as file:
            project = json.loads(file.read(1 << 22))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        refuse(path, f"no JSON: {error}", "a project file", "docs/train_your_own.md shows one")
    _check(path, "project", project, {"character", "garment", "clips"})
    folder = os.path.dirname(os.path.abspath(path))
    defaults = project.get("defaults", {})
    _check(path, "defaults", defaults, set())
    if not isinstance(project["clips"], list) or not project["clips"]:
        refuse(path, "no clips", "a list of clips")
    clips = []
    for number, own in enumerate(project["clips"]):
        _check(path, f"clip {number}", own, {"name", "animation", "cache"})
        clip = {"kind": "dynamic", "unit": "m", "up": "y", **defaults, **own}
        if clip["kind"] not in ("dynamic", "static"):
            refuse(path, f"kind '{clip['kind']}' of clip '{clip['name']}'", "dynamic or static")
        if any(c in clip["name"] for c in "\0\\") or clip["name"].startswith((".", "/")) or ".." in clip["name"]:
            refuse(path, f"clip name '{clip['name']}'", "a name such as walk or set1/walk")
        if not isinstance(clip.get("interpolate", False), bool):
            refuse(path, f"interpolate {clip['interpolate']!r}", "true or false")
        _number(path, clip, "fps", 1, 1000)
        _number(path, clip, "offset_seconds", -1e5, 1e5)
        for key in ("animation", "cache"):
            clip[key] = os.path.join(folder, clip[key])
        clips.append(clip)
    names = [stem(c) for c in clips]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice:
        refuse(path, f"two clips '{twice}'", "a name of its own for every clip")
    for key in ("body_meshes", "feature_joints"):
        value = project.get(key, [])
        if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
            refuse(path, f"{key} {value!r}", "a list of names")
    project.update(clips=clips, character=os.path.join(folder, project["character"]),
                   garment=os.path.join(folder, project["garment"]))
    if isinstance(project.get("map"), str):
        project["map"] = os.path.join(folder, project["map"])
    elif "map" in project and not (isinstance(project["map"], dict) and
                                   all(isinstance(v, str) for v in project["map"].values())):
        refuse(path, "map", 'a file name or an object {"joint": "node"}')
    return project


def stem(clip):
    return clip["name"].replace("/", "-")
