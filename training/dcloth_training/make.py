"""A garment of your own on a character of your own, the whole way: simulate, train, convert, show.

    python3 -m dcloth_training.make --character HERO.glb --garment DRESS.obj --out FOLDER
        [--clips walk.fbx,run.fbx] [--minutes 10] [--fabric wool] [--pin top] [--stages mesh] [--plan]

Says what it will cost, then works and says what is left; may be stopped at any time and started again with the same
arguments. --minutes 10 is a first look, --minutes 600 a night. FOLDER/index.html is the result.
"""
import argparse
import contextlib
import html
import json
import os
import subprocess
import sys
import time

import numpy as np

from . import bundle, command, fit_static, loop, patch_cut, rig, sequence, stages, train
from .motion import procedural
from .own import subject
from .simulate import clips, run as simulate, settings, statics
from .truth import animation
from .truth.errors import refuse

SIMULATING, TRAINING = 0.72, 0.2            # of the minutes; the rest: putting on, converting, the page
# of the minutes: a step's of stage 1, stage 2's, a step's of stage 3
STAGE_1, STAGE_2, STAGE_3 = 0.03, 0.1, 0.025
FIRST_LOOK = 60                 # minutes; in less, stage 1 is worth more epochs and stage 3 none
# Whose patches a new garment's begin with, where this package lies in its repository.
SKIRT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", "..", "models", "skirt", "skirt.safetensors"))
COLUMNS, ROWS = (16, 8, 4, 2), 8        # of patches on a side: the most that there are vertices for; points a patch
VERTICES_A_POINT = 4            # at least, on average: a point is a mean of cloth
FEWEST_CLIPS, FEWEST_DRAPES, MOST_DRAPES = 4, 14, 1200
ENOUGH_DRAPES, DRAPE_EVERY = 100, 5      # with fewer, every so many frames of clips stand in
DRAPE_SHARE = 0.15              # of the frames simulated
DRAPE_FRAMES = statics.MOVE_FRAMES + statics.HOLD_FRAMES
LEAD_FRAMES = settings.REACH_FRAMES + settings.HOLD_FRAMES
SCRIPTED_FRAMES = 150           # of a scripted clip, about
MOST_RANDOM = 1000              # made-up clips: 80 minutes of motion
VERTEX_SECONDS = 1.3e-5         # a frame, vertex and core, before it has been measured
SHOWN = "procedural/demo_walk_turn"                  # always held out: what the page shows
CHOOSING = "procedural/walk_slow_fast"               # chooses the epoch where too few clips are named
KEPT = ("character", "garment", "fabric", "pin", "refine", "clips", "minutes", "stages", "body_meshes",
        "garment_unit", "garment_up")


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--garment", required=True, help="a mesh on the character in its bind pose: dress.obj, dress.glb or "
                                         "file.glb#MESH")
    add("--out", required=True)
    add("--clips", default="", help="motion, the most important first, comma separated: clips of the character by name "
                                    "or number, files (walk.fbx, clips.glb#Run). Scripted ones fill the rest of the "
                                    "time")
    add("--minutes", type=float, default=10, help="that the whole way may take, about. 10: a first look; 600: a night")
    add("--stages", choices=stages.NAMES[1:], default="mesh",
        help="skeleton, mesh: the paper's stages, which read the pose and need drapes; patch: strips of cloth that see "
             "the limbs and need more motion and time")
    add("--workers", type=int, default=os.cpu_count() or 1, help="clips simulated side by side")
    add("--cluster", metavar="ADDRESS", help="of a Dask scheduler whose workers simulate; --workers says how many they "
                                             "are")
    add("--plan", action="store_true", help="say what it will cost and stop")
    subject.add_arguments(add)
    options = parser.parse_args(argv)
    if options.character is None:
        parser.error("--character HERO.glb is needed; our own figure and garments are simulated by simulate.run")
    if not options.minutes >= 2:
        parser.error(f"--minutes {options.minutes:g}: at least 2")
    if options.held_out:
        parser.error("--held-out: chosen here; the plan says which")
    options.root, options.motion = "free", None
    return options


def say(text):
    print(text, flush=True)


# The plan -------------------------------------------------------------------------------------------------------------

def _own_pieces(chosen, words):
    """[(name, frames)] of the clips that the user names."""
    return [(name, len(chosen.motion(name))) for word in words for name in chosen.group(word)]


def split(own):
    """(what the page shows, what chooses the epoch, the rest) of the user's clips: one of each from four on, where the
    last is held out and the one before it chooses."""
    names = [name for name, _ in own]
    if len(names) < FEWEST_CLIPS:
        return [SHOWN], [CHOOSING], names
    return [SHOWN, names[-1]], [CHOOSING, names[-2]], names[:-2]


def choose(own, frames, last):
    """What is simulated in about `frames` frames for stages up to `last`: {"held_out", "validation", "training": names,
    "drapes": how many, "frames": what that makes}."""
    held_out, validation, mine = split(own)
    length = dict(own)
    drapes = 0 if last == "patch" else max(FEWEST_DRAPES, min(MOST_DRAPES, round(DRAPE_SHARE * frames / DRAPE_FRAMES)))
    total = drapes * DRAPE_FRAMES + sum(length.get(name, SCRIPTED_FRAMES) + LEAD_FRAMES
                                        for name in held_out + validation)
    scripted = [name for name in clips.PROCEDURAL if name not in (SHOWN, CHOOSING)] + \
        [f"procedural/random_{seed}" for seed in range(MOST_RANDOM)]
    training = []
    for name in [*mine, *scripted]:
        cost = length.get(name, procedural.RANDOM_FRAMES if "random_" in name else SCRIPTED_FRAMES) + LEAD_FRAMES
        if len(training) >= FEWEST_CLIPS and name not in mine and total + cost > frames:
            break
        training.append(name)
        total += cost
    return {"held_out": held_out, "validation": validation, "training": training, "drapes": drapes, "frames": total}


def columns_of(path):
    """Columns of patches that the garment of a character.safetensors has vertices for. Refuses what cannot be cut."""
    character = rig.read_character(path)
    fitted = rig.fit(character, root_motion="air")
    skin = np.zeros((len(character.template), len(character.joint_names)))
    found = f"{len(character.template)} vertices"
    for columns in COLUMNS:
        if 2 * columns * ROWS * VERTICES_A_POINT > len(character.template):
            continue
        try:
            skin[:, fitted.rig.bones] = fit_static.fixed_weights("hung", fitted.rig, character.parents,
                                                                 fitted.initial_weights)
            patch_cut.make(character, skin, columns, ROWS)
            return columns
        except ValueError as error:
            found = str(error)
    return refuse(path, found, "cloth on the hips of a character with limbs", "train it with --stages mesh")


def make_plan(options, chosen):
    """The plan, also in FOLDER/plan.json; the one begun with, where there is one."""
    path = os.path.join(options.out, "plan.json")
    asked = json.loads(json.dumps({key: getattr(options, key) for key in KEPT}))
    if os.path.exists(path):
        with open(path, encoding="utf-8") as file:
            plan = json.load(file)
        other = [key for key in KEPT if plan["asked"].get(key) != asked[key]]
        if other:
            refuse(path, f"begun with --{other[0].replace('_', '-')} {plan['asked'].get(other[0])}, now "
                         f"{asked[other[0]]}",
                   "the same arguments", "name another --out, or give those it was begun with")
        _own_pieces(chosen, plan["words"])      # so that their names are known
        return plan
    words = [word for word in options.clips.split(",") if word and word != "static"]
    own = _own_pieces(chosen, words)
    character = os.path.join(options.out, "character.safetensors")
    vertices, began = len(chosen.worn.vertices), time.monotonic()
    if options.plan and not os.path.exists(character):
        a_frame = VERTEX_SECONDS * vertices
    else:
        say(f"putting the garment on, about {simulate.told_time(VERTEX_SECONDS * vertices * subject.PUT_ON)}")
        fresh = not os.path.exists(character)
        chosen.put_on()
        a_frame = (time.monotonic() - began) / subject.PUT_ON if fresh else VERTEX_SECONDS * vertices
    side_by_side = max(1, options.workers if options.cluster else min(options.workers, os.cpu_count() or 1))
    seconds = 60 * options.minutes * SIMULATING
    plan = {"asked": asked, "seconds_per_frame": a_frame, "words": words,
            **choose(own, seconds * side_by_side / a_frame, options.stages)}
    if options.stages == "patch" and os.path.exists(character):
        plan["columns"] = columns_of(character)
    plan["minutes"] = {"simulating": round(plan["frames"] * a_frame / side_by_side / 60, 1),
                       "training": round(options.minutes * TRAINING, 1)}
    if not options.plan:
        with open(path + ".part", "w", encoding="utf-8") as file:
            json.dump(plan, file, indent=1)
        os.replace(path + ".part", path)
    return plan


def tell(options, chosen, plan):
    frames, minutes = plan["frames"], plan["minutes"]
    vertices = len(chosen.worn.vertices)
    drapes = f", {plan['drapes']} drapes" if plan["drapes"] else ""
    say(f"plan: {len(plan['training'])} clips to learn from, {len(plan['validation'])} to choose the epoch by, "
        f"{len(plan['held_out'])} held out{drapes}: {frames:,} frames of {vertices:,} vertices")
    say(f"plan: about {minutes['simulating']:.0f} min of simulation ({1e3 * plan['seconds_per_frame']:.0f} ms a frame "
        f"and core, {options.workers} side by side), {minutes['training']:.0f} min of training, 1 min to convert and "
        f"show; {frames * vertices * 12 * 2 / 1e9:.1f} GB on disk")
    total = minutes["simulating"] + minutes["training"] + 1
    if total > 1.3 * options.minutes:
        least = f"{FEWEST_CLIPS} clips" + (f" and {FEWEST_DRAPES} drapes teach" if drapes else " teach")
        say(f"plan: that is {total:.0f} min and not {options.minutes:g}: fewer than {least} nothing; a coarser mesh is "
            "faster")
    if not plan["words"]:
        say("plan: no --clips: all motion is scripted (walks, runs, turns, kicks); name clips of your game for its own")


# The steps ------------------------------------------------------------------------------------------------------------

def clip_file(options, name):
    return os.path.join(options.out, "dynamic", clips.file_stem(name) + ".safetensors")


def bundle_file(options):
    return os.path.join(options.out, options.name + ".safetensors")


def simulated(options, chosen, plan):
    """Simulates what is missing; refused clips are told and left out."""
    names = [*plan["held_out"], *plan["validation"], *plan["training"]]
    if plan["drapes"]:
        names.insert(0, "static")
    options.clips, options.poses = ",".join(names), plan["drapes"]
    options.held_out = ",".join(plan["held_out"] + plan["validation"])
    refused = simulate.run(options, chosen)
    there = {name: os.path.exists(clip_file(options, name)) for name in names if name != "static"}
    if refused:
        say(f"{refused} clips are not cloth and left out; manifest.jsonl says why")
    left = {kind: [name for name in plan[kind] if there[name]] for kind in ("held_out", "validation", "training")}
    good = sum(map(len, left.values()))
    drapes = os.path.join(options.out, "static")
    if good < FEWEST_CLIPS or plan["drapes"] and not (os.path.isdir(drapes) and os.listdir(drapes)):
        refuse(os.path.join(options.out, "manifest.jsonl"), f"{good} clips of {len(there)} that are cloth",
               f"{FEWEST_CLIPS} at least" + (", and some drapes" if plan["drapes"] else ""),
               "the reasons stand there; mend the garment or its pins and name another --out")
    for kind in ("held_out", "validation"):     # one that was to teach takes a refused one's place
        if not left[kind]:
            left[kind].append(left["training"].pop())
            say(f"{left[kind][0]} takes the place of {', '.join(plan[kind])}")
    return left


def stand_ins(options, there, drapes):
    """static/drapes-of-clips.safetensors: where there are few drapes, stage 1 learns a pose's mean shape from clips,
    too."""
    path = os.path.join(options.out, "static", "drapes-of-clips.safetensors")
    if drapes >= ENOUGH_DRAPES or os.path.exists(path):
        return
    read = [sequence.read(clip_file(options, name)) for name in there["training"]]
    sequence.write(path, sequence.Sequence(
        np.concatenate([item.joint_matrices[::DRAPE_EVERY] for item in read]),
        np.concatenate([item.truth[::DRAPE_EVERY] for item in read]), read[0].joint_names, read[0].fps,
        "drapes-of-clips", "static"))
    say(f"{drapes} drapes are few: every {DRAPE_EVERY}th frame of the clips to learn from stands in, too")


def of_stages(options, plan):
    """Options of train for the stages asked for."""
    if options.stages == "patch":
        return ["--stages", "patch", "--static-base", "hung", "--root-motion", "air", "--patch-rows", str(ROWS),
                "--patch-columns", str(plan["columns"]), "--patch-epochs", "400"] + \
            (["--patch-from", SKIRT] if os.path.exists(SKIRT) else [])
    quick = options.minutes < FIRST_LOOK
    last = "skeleton" if quick else options.stages
    return ["--stages", last, "--static-epochs", "600" if quick else "200", "--skeleton-epochs", "400",
            "--settle-epochs", "6" if quick else "20", "--mesh-epochs", "40"]


def trained(options, there, plan):
    """FOLDER/<garment>.safetensors, the bundle."""
    path = bundle_file(options)
    if os.path.exists(path):
        return path
    if plan["drapes"]:
        stand_ins(options, there, plan["drapes"])
    chosen = train.arguments([
        "--data", options.out, "--out", os.path.join(options.out, "training"), "--export", path,
        "--validation", ",".join(there["validation"]), "--held-out", ",".join(there["held_out"]),
        "--threads", str(min(2, options.workers)), *of_stages(options, plan)])
    share = {"static": STAGE_1, "static_pruned": STAGE_1, "skeleton": STAGE_2, "mesh_head": STAGE_3,
             "mesh_layers": STAGE_3, "patch": TRAINING}
    with loop.limited({stage: options.minutes * part for stage, part in share.items()}):
        net, fitted, character, provenance = train.run(chosen)
    bundle.write(path, net, fitted, character, provenance, options.name)
    return path


def _dcloth(options, *words):
    result = subprocess.run([animation.find_command(options.dcloth), *map(str, words)], capture_output=True, text=True,
                            check=False)
    if result.returncode:
        raise ValueError(result.stderr.strip().replace("dcloth: error: ", "") or f"dcloth {words[0]} failed")
    return result.stdout


def shown(options, bundle_path, there):
    """The model, the report on held-out clips, and the page about it all."""
    out = options.out
    model = os.path.join(out, options.name + ".dcloth")
    sequences = [clip_file(options, name) for name in there["held_out"]]
    if not os.path.exists(model):
        _dcloth(options, "convert", bundle_path, "-o", model, "--precision", "int8")
    report, numbers = os.path.join(out, "report.html"), os.path.join(out, "evaluate.json")
    if not os.path.exists(numbers):
        found = _dcloth(options, "evaluate", bundle_path, *sequences, "--precision", "int8", "--json", "--html", report)
        with open(numbers + ".part", "w", encoding="utf-8") as file:
            file.write(found)
        os.replace(numbers + ".part", numbers)
    page(options, model, numbers, there)


def page(options, model, numbers, there):
    """FOLDER/index.html: what was made, how well, and the way to it; the 3D report stands in it."""
    with open(numbers, encoding="utf-8") as file:
        variants = json.load(file)["variants"]
    rows = ""
    for variant in variants:
        truth = variant["truth"]
        cost = f"{variant['tick_ms']['p50']:.2f}" if variant["tick_ms"] else "0"
        if truth:
            rows += (f"<tr><td>{html.escape(variant['name'])}</td><td>{truth['position_mm']['mean']:.1f}</td>"
                     f"<td>{100 * truth['relative_error']:.0f}</td><td>{cost}</td></tr>")
    with open(os.path.join(options.out, "manifest.jsonl"), encoding="utf-8") as file:
        entries = [json.loads(line) for line in file]
    hours = sum(entry.get("seconds", 0) for entry in entries) / 3600
    refused = [entry for entry in entries if "refused" in entry]
    bad = "".join(f"<li>{html.escape(entry['clip'])}: {html.escape(entry['refused'])}</li>" for entry in refused)
    name = html.escape(options.name)
    text = f"""<!doctype html><meta charset="utf-8"><title>{name}</title>
<style>
body{{font:16px system-ui,sans-serif;margin:2rem auto;max-width:75rem;padding:0 1rem;color:#222;background:#fafafa}}
table{{border-collapse:collapse}}td,th{{padding:.3rem .8rem;border-bottom:1px solid #ddd;text-align:right}}
td:first-child,th:first-child{{text-align:left}}
iframe{{width:100%;height:46rem;margin-top:1.5rem;border:1px solid #ddd;background:#fff}}</style>
<h1>{name} on {html.escape(os.path.basename(options.character))}</h1>
<p>Learned from {len(there['training'])} clips; measured on {html.escape(', '.join(there['held_out']))}, which training
never read. {hours:.2f} core hours of simulation.
<a href="{name}.dcloth">{name}.dcloth</a> is {os.path.getsize(model) / 1e6:.2f} MB.
</p>
<table>
<tr><th>variant</th><th>error, mm</th><th>error, % of the cloth's own motion</th><th>ms a tick</th></tr>
{rows}</table>
{f"<p>Refused clips:</p><ul>{bad}</ul>" if refused else ""}
<iframe src="report.html" title="the garment in motion"></iframe>
"""
    path = os.path.join(options.out, "index.html")
    with open(path + ".part", "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(path + ".part", path)


def work(options):
    began = time.monotonic()

    def left(step, rest):
        say(f"[{step}/4, {(time.monotonic() - began) / 60:.1f} min] {rest}")

    animation.find_command(options.dcloth)      # before the work rather than after it
    chosen = subject.Own(options)
    options.name = chosen.worn.name
    plan = make_plan(options, chosen)
    tell(options, chosen, plan)
    if options.plan:
        return
    names = plan["held_out"] + plan["validation"] + plan["training"]
    missing = [name for name in names if not os.path.exists(clip_file(options, name))]
    to_train = 0 if os.path.exists(bundle_file(options)) else plan["minutes"]["training"]
    to_simulate = plan["minutes"]["simulating"] * len(missing) / len(names)
    left(1, f"simulating; about {simulate.told_time(60 * (to_simulate + to_train + 1))} left")
    there = simulated(options, chosen, plan)
    left(2, f"training; about {simulate.told_time(60 * (to_train + 1))} left")
    path = trained(options, there, plan)
    left(3, "converting and measuring; about 60 s left")
    shown(options, path, there)
    left(4, f"done: {os.path.join(options.out, 'index.html')}")


def main(argv=None):
    options = arguments(argv)
    with contextlib.suppress(KeyboardInterrupt):
        return command.ended("make", lambda: work(options))
    print("make: stopped; the same command goes on from here", file=sys.stderr)
    return 130


if __name__ == "__main__":
    sys.exit(main())
