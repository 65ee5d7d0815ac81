"""Train one garment in its stages.

    python3 -m dcloth_training.train --data DIR --out DIR [--export BUNDLE]

DIR/--data holds character.safetensors, dynamic/ and static/ (simulate/run.py makes them). Stops
and resumes at any epoch; writes checkpoints, log.json, curves.png, network.safetensors and measures.txt
(every measure on the validation clips) under --out.
"""
import argparse
import json
import os
import sys
import time
from dataclasses import dataclass, field

import numpy as np
import torch

from . import (assemble, augment, begun, bundle, checkpoint, command, dataset, evaluate, export, features, loop,
               network, plots, rig, sequence, shards, stages, train_checks, workers)
from .stages.mesh_stage import BodyPoints


# What --freeze keeps from training: pivots start at D = 0, weights at the nearest-point weights.
FROZEN = {"pivots": "mlp", "weights": "residual_weights"}

ROOT_MOTION_TEXT = {"none": "", "hips": " and root motion", "air": " and the air around the hips"}


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--data", required=True)
    add("--more-data", help="folder of more clips of the garment, such as those with the hips held in place")
    add("--out", required=True)
    add("--start", help="bundle or folder of a finished training to go on from: its features and stage 1 stay, stage 2 "
                        "or the patch stage learns on")
    add("--export", help="bundle to write at the end")
    add("--validation", default=",".join((*dataset.VALIDATION, *dataset.VALIDATION_TAKES, "validation/")),
        help="clips, takes or groups (validation/) that choose the epoch, comma separated")
    add("--held-out", default=",".join(dataset.HELD_OUT),
        help="clips to measure the network on, never read here, comma separated; the bundle names them")
    add("--seed", type=int, default=1)
    add("--threads", type=int, default=2)
    add("--device", choices=("cpu", "cuda"), default="cpu",
        help="where the stages learn; the same input gives the same bits on the CPU alone")
    add("--shards", type=int, choices=shards.COUNTS, default=1,
        help="parts of a batch whose gradients are computed apart: torchrun's workers, so many at most, share them. "
             "The bits depend on the shards, not on the workers")
    add("--rate", type=float, default=1e-3)
    add("--stages", choices=stages.NAMES, default=stages.LAST.name, help="last stage to train")
    add("--freeze", choices=sorted(FROZEN), help="ablation: leave this part of stage 1 as it starts")
    add("--root-motion", choices=tuple(features.ROOT_NUMBERS), default="hips",
        help="root-motion features: none, the hips' velocity, or the velocity of the air around them and the hips' "
             "acceleration (for clips simulated in air that stands still or blows; see --data's wind)")
    add("--validate-every", type=int, default=5)
    add("--head-data", help="folder of clips that stage 2 never sees, for stage 3")
    for stage in stages.STAGES:
        for name, (default, _, what) in stage.fit.OPTIONS.items():
            add("--" + name, type=type(default), default=default, help=what)
    options = parser.parse_args(argv)
    train_checks.ranges(options, parser.error)
    train_checks.device(options, parser.error)
    train_checks.apart(options, parser.error)
    return options


@torch.no_grad()
def body_statistics(fitted, clips, every=10):
    """Mean and deviation [3] of the posed nearest body points over training."""
    body = BodyPoints(fitted.nearest_points, fitted.nearest_weights)
    points = torch.cat([body(c.pose.body_frame[::every]).reshape(-1, 3) for c in clips]).double()
    return points.mean(0).float(), points.std(0).float()


def feature_rows(clips, options):
    """Features [N, d] of all clips as they are and, with root motion, as windows are carried."""
    rows = [c.pose.x.double().numpy() for c in clips]
    if options.carried and options.root_motion == "hips":
        generator = np.random.default_rng(options.seed)
        deviation = options.carried * np.array(augment.CARRIED)
        rows += [features.carried(x, deviation * generator.standard_normal(3), c.rate)
                 for x, c in zip(rows, clips)]
    return np.concatenate(rows)


class Log:
    def __init__(self, folder):
        self.began, self.path = time.monotonic(), os.path.join(folder, "train.log")

    def __call__(self, text):
        if not workers.first():
            return
        line = f"[{(time.monotonic() - self.began) / 60:6.2f} min] {text}"
        print(line, flush=True)
        with open(self.path, "a") as file:
            file.write(line + "\n")


def images_of(character):
    return "clips with mirror images" if character.mirror is not None else "clips"


def prepare(options, log):
    """Character, fit and clips -> (character, fitted, static clips, training, validation)."""
    character = rig.read_character(os.path.join(options.data, "character.safetensors"))
    fitted = rig.fit(character, root_motion=options.root_motion)
    names = [character.joint_names[b] for b in fitted.rig.bones]
    static = dataset.load(dataset.find(options.data, "static"), fitted.rig, character)
    if not static and options.static_base == "learned":
        raise ValueError(f"{os.path.join(options.data, 'static')}: no clips; stage 1 learns from quasi-static drapes, "
                         "unless --static-base is rigid or hung")
    folders = [options.data] + ([options.more_data] if options.more_data else [])
    held_out = dataset.clip_names(options.held_out)
    if options.more_data and not dataset.find(options.more_data, "dynamic", held_out):
        raise ValueError(f"{os.path.join(options.more_data, 'dynamic')}: no clips; --more-data names a folder like "
                         "--data")
    dynamic = [c for folder in folders for c in dataset.load(
        dataset.find(folder, "dynamic", held_out), fitted.rig, character)]
    wanted, there = options.validation.split(","), sorted({c.name for c in dynamic})
    training, validation = dataset.split(dynamic, wanted)
    for what, clips in (("static", static), ("training", training), ("validation", validation)):
        if not clips and what != "static":
            raise ValueError(f"{options.data}: no {what} clips; --validation {options.validation} of "
                             f"{', '.join(there[:20]) or 'no clips'}{', ...' if len(there) > 20 else ''}")
        log(f"{what}: {len(clips)} {images_of(character)}, {sum(map(len, clips))} frames")
    kept_out = [name for name in held_out if any(os.path.exists(dataset.path_of(folder, name)) for folder in folders)]
    if kept_out:
        log(f"held out, never read: {', '.join(kept_out)}")
    if held_out != dataset.HELD_OUT and len(kept_out) < len(held_out):
        log(f"held out: no clip {', '.join(name for name in held_out if name not in kept_out)}")
    absent = [name for name in wanted if not any(dataset.named(clip, [name]) for clip in there)]
    if absent:
        log(f"validation: no clip {', '.join(absent)}")
    log(f"bones: {', '.join(names)}")
    return character, fitted, static, training, validation


def frames(clips):
    """Without mirror images."""
    return sum(len(c) for c in clips if not c.mirrored)


def by_folder(clips):
    """{name of the data folder: clip names}: which clip was learned with root motion, which with the hips held."""
    found = {}
    for clip in clips:
        folder = os.path.basename(os.path.dirname(os.path.dirname(os.path.abspath(clip.path))))
        found.setdefault(folder, set()).add(clip.name)
    return {folder: sorted(names) for folder, names in sorted(found.items())}


def told(rig):
    """A rig's features in words."""
    return ", ".join(rig.joint_names[j] for j in rig.feature_joints) + (ROOT_MOTION_TEXT[rig.root_motion])


def learned(provenance):
    """Clips that a network learned from, also before the training that it was started from."""
    return set() if not provenance else \
        {*provenance.get("training_clips", []), *provenance.get("stage_3_clips", []),
         *learned(provenance.get("started_from"))}


def start_from(options, fitted):
    """The network of --start -> (network, its features' statistics, its provenance)."""
    if os.path.isfile(options.start):
        net, other, _, metadata = bundle.read(options.start, torch.float32)
        provenance = json.loads(metadata.get("training", "{}"))
        export.refuse_another_garment(options.start, net.static.initial_weights, options.data, fitted)
    else:
        net, worn, _, provenance = export.load_trained(options.start, options.data)
        other = worn.rig
    if (net.patch is None) == (options.stages == "patch"):
        raise ValueError(f"--start {options.start}: found {'no ' if net.patch is None else ''}patches; it goes on with "
                         f"--stages {'skeleton or mesh' if net.patch is None else 'patch'}")
    if net.patch is None and (net.skeleton is None or other.feature_joints != fitted.rig.feature_joints or \
                              len(net.skeleton.basis) != options.skeleton_size or
                              other.root_motion != fitted.rig.root_motion):
        found = "no stage 2" if net.skeleton is None else f"k_S = {len(net.skeleton.basis)} over {told(other)}"
        raise ValueError(f"--start {options.start}: found {found}; expected k_S = {options.skeleton_size} over "
                         f"{told(fitted.rig)}; give the options it was trained with")
    if net.static.mlp[0].out_features != options.static_width:
        raise ValueError(f"--start {options.start}: found a static stage {net.static.mlp[0].out_features} wide; give "
                         f"the options it was trained with, --static-width {net.static.mlp[0].out_features}")
    known = sorted(learned(provenance) & set(dataset.clip_names(options.held_out)))
    if known:
        raise ValueError(f"--start {options.start}: learned from {', '.join(known[:3])}; --held-out takes clips that "
                         f"no training read; hold out others, or start anew")
    standard = {k: getattr(net.standardise, k).double().numpy() for k in ("mean", "deviation", "low", "high")}
    return net, standard, provenance


@dataclass
class Run:
    """What a stage's training (fit_*.train_stage) works with: the network on --device, clips and options."""
    options: argparse.Namespace
    log: Log
    character: rig.Character
    fitted: rig.Fit
    static_clips: list
    training: list
    validation: list
    net: network.DCloth = None
    before: network.DCloth = None                       # of --start
    known: set = field(default_factory=set)             # clips that it learned from
    stage_3_clips: list = field(default_factory=list)   # what stage 3 learned from

    @property
    def images(self):
        return images_of(self.character)

    def unskin(self, clips):
        """Fill the clips' residuals from files below --out."""
        workers.divided(clips, lambda some: dataset.add_residuals(
            some, self.net.static, self.net.standardise, self.character, os.path.join(self.options.out, "unskinned")))

    def unseen_clips(self):
        """Clips of --head-data, which neither stage 2 learned from nor anybody chooses epochs by."""
        folder = self.options.head_data
        apart = dataset.clip_names(self.options.held_out) + dataset.clip_names(self.options.validation)
        clips = dataset.load(dataset.find(folder, "dynamic", apart), self.fitted.rig, self.character)
        known = sorted({c.name for c in clips} & {c.name for c in self.training})
        if known or not clips:
            raise ValueError(f"{folder}: found {', '.join(known[:3]) or 'no clips'}; allowed are clips that "
                             f"stage 2 does not learn from; simulate others (--clips variations)")
        return clips


def measure(net, fitted, character, validation, folder, log):
    """folder/measures.json and .txt: every measure of each level on the validation clips, no crossings. 50 ms a
    frame."""
    results = {}
    for clip in validation:
        if not clip.mirrored:
            item = sequence.read(clip.path)
            name = clip.name if clip.name not in results else clip.path     # with root motion, and with the hips held
            results[name] = evaluate.evaluate(net, fitted.rig, character.faces, item, clip.path)
    evaluate.write(results, os.path.join(folder, "measures"), picture=False)
    for source, rows in evaluate.by_source(results):
        found = evaluate.overall(rows)
        for level in evaluate.level_names(found):
            told = dict(zip((title for title, _, _ in evaluate.FIGURES), evaluate.figures(found[level])))
            log(f"validation, {source}, {level}: {told['E_d mm']} mm of {found['truth']['alive_mm']:.2f} motion, "
                f"relative error {told['relative error']}, coarse / middle / fine {told['coarse mm']} / "
                f"{told['middle mm']} / {told['fine mm']} mm, energy {told['energy coarse']} / {told['middle']} / "
                f"{told['fine']}")


def run(options):
    """Train all stages -> (network, fitted, character, provenance)."""
    if options.export:
        command.folder_of(options.export)
    os.makedirs(options.out, exist_ok=True)
    workers.use_threads(options.threads)
    log = Log(options.out)
    whole = Run(options, log, *prepare(options, log))
    fitted, character, training, validation = whole.fitted, whole.character, whole.training, whole.validation
    train_checks.lengths(training, options, log)
    if workers.first():
        begun.check(options, whole.static_clips + training + validation, log)
    history, rows = {}, feature_rows(training, options)
    if options.start:
        whole.before, standard, history = start_from(options, fitted)
        whole.known, standard = learned(history), features.widened(standard, rows)
    else:
        standard = features.fit_standard(rows)
    chosen = stages.up_to(options.stages)
    statistics = body_statistics(fitted, training) if "mesh" in [stage.name for stage in chosen] else None
    net = whole.net = assemble.build(fitted, character, standard, options, statistics, options.stages)
    if options.freeze:
        getattr(net.static, FROZEN[options.freeze]).requires_grad_(False)
    net.to(options.device)
    histories = {}
    for stage in chosen:
        histories.update(stage.fit.train_stage(whole))
        workers.same(net)
        getattr(net, stage.name).requires_grad_(False)
    net.cpu()
    provenance = {
        "command": {k: v for k, v in vars(options).items()
                    if k not in ("data", "more_data", "out", "export", "head_data", "start", "held_out", "device",
                                 "patch_from")},
        "started_from": history, "patches_from": os.path.basename(options.patch_from) or None,
        "torch": torch.__version__, "minutes": round((time.monotonic() - log.began) / 60, 1),
        "training_clips": sorted({c.name for c in training}),
        "training_folders": by_folder(training),
        "stage_3_clips": sorted({c.name for c in whole.stage_3_clips}),
        "validation_clips": sorted({c.name for c in validation}),
        "held_out_clips": list(dataset.clip_names(options.held_out)),
        "frames": {"training": frames(training), "validation": frames(validation),
                   "static": frames(whole.static_clips)},
        "validation_mm": {k: round(loop.kept(v)["validation_mm"], 3)
                          for k, v in histories.items()},
        "licence": "MIT"}
    if workers.first():
        checkpoint.save(os.path.join(options.out, "network.safetensors"),
                        {"state": net.state_dict(), "standard": {k: torch.from_numpy(v)
                                                                 for k, v in standard.items()},
                         "options": json.dumps(vars(options)), "provenance": json.dumps(provenance)})
        with open(os.path.join(options.out, "log.json"), "w") as file:
            json.dump({"histories": histories, "provenance": provenance}, file, indent=1)
        plots.curves(histories, os.path.join(options.out, "curves.png"))
        measure(net, fitted, character, validation, options.out, log)
    return net, fitted, character, provenance


def main(argv=None):
    options = arguments(argv)

    def work():
        with workers.joined(options):
            net, fitted, character, provenance = run(options)
            if options.export and workers.first():
                bundle.write(options.export, net, fitted, character, provenance)
    return command.ended(workers.called("train"), work)


if __name__ == "__main__":
    sys.exit(main())
