"""What a training folder was begun with: finished steps are not trained again, whatever has changed since."""
import json
import os

# Folders may move, and a training may go on to the next stage.
FREE = ("data", "more_data", "head_data", "start", "out", "export", "threads", "device", "stages")


def _input(options, clips):
    told = {}    # a clip with root motion and one with the hips held have the same name
    for path in sorted({c.path for c in clips}):
        stat = os.stat(path)
        told.setdefault(os.path.basename(path), []).append([stat.st_size, stat.st_mtime_ns])
    return {"options": {k: v for k, v in vars(options).items() if k not in FREE},
            "clips": {name: sorted(files) for name, files in told.items()}}


def _changes(before, now):
    """What differs, in words."""
    out = [f"--{name.replace('_', '-')} {before['options'][name]}, now {value}"
           for name, value in now["options"].items() if before["options"].get(name, value) != value]
    old, new = before["clips"], now["clips"]
    for word, names in (("new", set(new) - set(old)), ("gone", set(old) - set(new)),
                        ("changed", {n for n in set(old) & set(new) if old[n] != new[n]})):
        if names:
            out.append(f"{word}: {', '.join(sorted(names)[:3])}"
                       + (f" and {len(names) - 3} more" if len(names) > 3 else ""))
    return out


def check(options, clips, log):
    """Notes the input in a new folder; in one that was begun, tells what is another now."""
    path, now = os.path.join(options.out, "begun.json"), json.loads(json.dumps(_input(options, clips)))
    if os.path.exists(path):
        with open(path) as file:
            found = _changes(json.load(file), now)
        if found:
            log(f"{options.out} was begun with other input ({'; '.join(found)}): steps that are finished there stay as "
                "they are; to train them on this input, name another --out")
        return
    with open(path + ".part", "w") as file:
        json.dump(now, file, indent=1)
    os.replace(path + ".part", path)
