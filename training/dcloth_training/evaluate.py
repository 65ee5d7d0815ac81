"""Every measure of a bundle on clips it never saw, stage by stage.

    python3 -m dcloth_training.evaluate BUNDLE SEQUENCE... [-o PREFIX] [--quick]

Levels: rigid hips (the template fixed to the hips), plain skinning with the nearest-point weights, stage 1, stages 1-2,
stages 1-3. Reported, other recorded and scripted clips are tables of their own. With -o writes PREFIX.json ({clip:
{"truth": measures, level: measures}}; metrics.py says what each measure means), PREFIX.txt and PREFIX.png. Penetration
and crossings are counted on every fifth frame, by exact tests; --quick leaves them out.
"""
import argparse
import dataclasses
import json
import sys

import numpy as np
import torch

from . import bundle, command, dataset, metrics, plots, reference, safetensors_io, sequence, stages
from .motion import skeleton
from .simulate import crossings, penetration

SCALE, PLAIN = "rigid hips", "plain skinning"
LEVELS = {stage.name: stage.title for stage in stages.STAGES}
EVERY = 5               # frames from one to the next whose crossings are counted
HELD = (30, 60)         # ticks of the last pose, held after the clip, between which jitter.held_mm is measured


class Referee:
    """The body that a bundle carries: who crosses it, and how deep. Body as penetration.Body, `posed` by skinning."""

    def __init__(self, path):
        tensors, _ = safetensors_io.read(path)
        missing = [name for name in ("character.bind", "body.positions", "body.faces", "body.joint_weights",
                                     "template.positions", "template.faces") if name not in tensors]
        if missing:
            raise safetensors_io.SafetensorsError(f"{path}: no tensors {missing}: not a training bundle with its body")
        self.bind = [tensors[name].astype(np.float64) for name in ("body.positions", "body.joint_weights",
                                                                   "character.bind")]
        self.faces, template = tensors["template.faces"], tensors["template.positions"]
        masks = tensors.get("body.parts")
        if masks is None and "body.collides" in tensors:
            masks = (tensors["body.collides"] > 0.5).astype(np.uint32)
        self.body = penetration.Body(tensors["body.faces"], self.faces, len(template), masks=masks,
                                     touches=tensors.get("template.touches"))
        self.body_faces = tensors["body.faces"]
        self.areas = penetration.vertex_areas(template, self.faces)

    def measures(self, positions, matrices):
        """{"penetration", "crossings"} of every fifth counted frame of positions [T, n, 3], matrices [T, J, 4, 4]."""
        at = np.arange(metrics.counted(len(positions)), len(positions), EVERY)
        depths, own, against = [], 0, 0
        for cloth, body in zip(np.asarray(positions, np.float64)[at],
                               skeleton.skin(*self.bind, np.asarray(matrices, np.float64)[at])):
            depth, pairs = self.body.contact(cloth, body)
            depths.append(depth)
            own, against = own + len(crossings.within(cloth, self.faces)), against + len(pairs)
        found = penetration.summary(depths, self.areas)
        return {"penetration": {key: found[key] for key in ("area_share", "p99_mm")},
                "crossings": {"cloth": own / len(at), "body": against / len(at)}}


@torch.no_grad()
def skinned(net, rig, pose, weights):
    """Linear blend skinning of the template: `weights` [n, m], pivots where they were bound."""
    static = net.static
    offset = pose.posed - (pose.linear @ static.pivots.unsqueeze(-1)).squeeze(-1)
    bones = torch.cat([pose.linear, offset.unsqueeze(-1)], -1)
    return torch.stack([static.skin(static.blend(b, weights)) for b in bones])


def levels(net, rig, item, path="sequence"):
    """Yields (level, positions [T, n, 3]) of a sequence, from the simplest to the whole network."""
    pose = reference.pose_for(item, rig, net.static.template.dtype, path)
    rigid = torch.zeros_like(net.static.initial_weights)
    if rig.hips in rig.bones:
        rigid[:, rig.bones.index(rig.hips)] = 1
        yield SCALE, skinned(net, rig, pose, rigid)
    yield PLAIN, skinned(net, rig, pose, net.static.initial_weights)
    for stage in stages.up_to(net.last_stage()):
        yield stage.title, net.run(pose, stage.name)


def with_hold(item):
    """The sequence with its last pose, and wind, held for HELD[1] frames more; without truth."""
    def held(values):
        return None if values is None else np.concatenate([values, np.repeat(values[-1:], HELD[1], 0)])
    return dataclasses.replace(item, joint_matrices=held(item.joint_matrices), wind=held(item.wind), truth=None)


def evaluate(net, rig, faces, item, path="sequence", referee=None):
    """{"truth": measures of the truth itself, level: measures} of one sequence with truth.

    referee: counts crossings and penetration too, 0.1 s a frame and level at most.
    """
    if item.truth is None:
        raise ValueError(f"{path}: no truth to compare with")
    if item.truth.shape[1] != len(net.static.template):
        raise ValueError(f"{path}: truth of {item.truth.shape[1]} vertices, the bundle's garment has "
                         f"{len(net.static.template)}")
    frames, matrices = len(item.truth), reference.matrices_for(item, rig, path)
    truth = metrics.Truth(item.truth, matrices[:, rig.hips], metrics.Mesh(faces, net.static.template.double().numpy()))
    out = {"truth": truth.measures()}
    if referee:
        out["truth"].update(referee.measures(item.truth, matrices))
    for level, positions in levels(net, rig, with_hold(item), path):
        positions = positions.double().numpy()
        found = metrics.clip(positions[:frames], truth)
        found["jitter"]["held_mm"] = metrics.held_mm(positions[frames + HELD[0]:])
        if referee:
            found.update(referee.measures(positions[:frames], matrices))
        out[level] = found
    return out


def by_source(results):
    """Yields ("reported", "recorded" or "scripted", {clip: row}), those with clips: never averaged together.

    reported: the recorded clips that nothing was decided on (dataset.REPORTED).
    """
    def group(clip):
        return "reported" if dataset.role(clip) == "reported" else dataset.source(clip)

    for source in ("reported", "recorded", "scripted"):
        rows = {clip: row for clip, row in results.items() if group(clip) == source}
        if rows:
            yield source, rows


def level_names(row):
    return [name for name in row if name != "truth"]


def overall(rows):
    """{"truth" or level: measures over the clips} of {clip: row}."""
    names = list(next(iter(rows.values())))
    return {name: metrics.over_clips([row[name] for row in rows.values() if name in row]) for name in names}


# (title, keys, form) of the figures in a table of levels.
FIGURES = (("E_d mm", ("position_mm", "mean"), "{:.2f}"), ("relative error", ("relative_error",), "{:.3f}"),
           ("E_n deg", ("normal_deg", "mean"), "{:.2f}"), ("offset mm", ("offset_mm",), "{:.2f}"),
           ("motion error mm", ("motion_error_mm",), "{:.2f}"), ("relative", ("relative_motion_error",), "{:.3f}"),
           ("coarse mm", ("bands", "coarse", "error_mm"), "{:.2f}"),
           ("middle mm", ("bands", "middle", "error_mm"), "{:.2f}"),
           ("fine mm", ("bands", "fine", "error_mm"), "{:.2f}"),
           ("energy coarse", ("bands", "coarse", "energy_ratio"), "{:.2f}"),
           ("middle", ("bands", "middle", "energy_ratio"), "{:.2f}"),
           ("fine", ("bands", "fine", "energy_ratio"), "{:.2f}"),
           ("area under body", ("penetration", "area_share"), "{:.3%}"),
           ("depth p99 mm", ("penetration", "p99_mm"), "{:.1f}"),
           ("pairs cloth", ("crossings", "cloth"), "{:.1f}"), ("pairs body", ("crossings", "body"), "{:.1f}"),
           ("strain p99", ("strain_p99",), "{:.1%}"), ("jitter", ("jitter", "ratio"), "{:.2f}"),
           ("held mm", ("jitter", "held_mm"), "{:.4f}"), ("calm mm", ("calm_mm",), "{:+.2f}"))


def at(measures, keys):
    """A figure deep in measures, or None."""
    for key in keys:
        measures = (measures or {}).get(key)
    return measures


def figures(measures):
    """Texts of FIGURES, "-" where a figure is not known."""
    found = [at(measures, keys) for _, keys, _ in FIGURES]
    return ["-" if value is None else form.format(value) for value, (_, _, form) in zip(found, FIGURES)]


def table(results):
    """Text, a table a source (by_source): a row a clip with E_d and E_n of each level, then all measures."""
    lines = []
    for source, rows in by_source(results):
        names = level_names(next(iter(rows.values())))
        lines += [f"{source} clips", f"{'clip':34}{'motion':>8}" + "".join(f"{name:>26}" for name in names)]
        for clip, row in rows.items():
            cells = [f"{row[n]['position_mm']['mean']:6.1f} +- {row[n]['position_mm']['std']:4.1f} mm "
                     f"{row[n]['normal_deg']['mean']:5.1f} deg" for n in names]
            lines.append(f"{clip:34}{row['truth']['alive_mm']:8.1f}" + "".join(f"{cell:>26}" for cell in cells))
        lines.append("")
        found = overall(rows)
        columns = [figures(found[name]) for name in ("truth", *names)]
        lines.append(f"{'over the clips':20}" + "".join(f"{name:>21}" for name in ("truth", *names)))
        lines += [f"{title:20}" + "".join(f"{column[k]:>21}" for column in columns)
                  for k, (title, _, _) in enumerate(FIGURES)]
        lines.append("")
    return "\n".join(lines[:-1])


def write(results, prefix, picture=True):
    """prefix.json, prefix.txt and, unless `picture` is false, prefix.png."""
    with open(prefix + ".json", "w") as file:
        json.dump(results, file, indent=1)
    with open(prefix + ".txt", "w") as file:
        file.write(table(results) + "\n")
    if picture:
        plots.bars({clip: {level: row[level]["position_mm"]["mean"] for level in level_names(row)}
                    for clip, row in results.items()}, prefix + ".png")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bundle")
    parser.add_argument("sequences", nargs="+")
    parser.add_argument("-o", "--output", help="prefix of .json, .txt and .png")
    parser.add_argument("--quick", action="store_true", help="without penetration and crossings")
    parser.add_argument("--float64", action="store_true", help="as the reference; half as fast")
    options = parser.parse_args(argv)

    def work():
        if options.output:
            command.folder_of(options.output)
        net, rig, faces, _ = bundle.read(options.bundle,
                                         torch.float64 if options.float64 else torch.float32)
        referee = None if options.quick else Referee(options.bundle)
        results = {}
        for path in options.sequences:
            item = sequence.read(path)
            name = path if item.clip in results else item.clip or path
            results[name] = evaluate(net, rig, faces, item, path, referee)
        print(table(results))
        if options.output:
            write(results, options.output)
    return command.ended("evaluate", work)


if __name__ == "__main__":
    sys.exit(main())
