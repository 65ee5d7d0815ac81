"""Errors of a bundle on clips it never saw, level by level.

    python3 -m dcloth_training.evaluate BUNDLE SEQUENCE... [-o PREFIX]

Levels: rigid hips (for scale), plain skinning with the nearest-point weights, stage 1, stages 1-2,
stages 1-3. Prints a table; with -o writes PREFIX.json, PREFIX.txt and PREFIX.png.
"""
import argparse
import json
import sys

import torch

from . import bundle, command, metrics, network, plots, reference, sequence

SCALE, PLAIN = "rigid hips", "plain skinning"
LEVELS = {"static": "stage 1", "skeleton": "stages 1-2", "mesh": "stages 1-3"}


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
    for stage in network.STAGES[:network.STAGES.index(net.last_stage()) + 1]:
        yield LEVELS[stage], net.run(pose, stage)


def evaluate(net, rig, faces, item, path="sequence"):
    """{level: metrics} of one sequence with truth."""
    if item.truth is None:
        raise ValueError(f"{path}: no truth to compare with")
    if item.truth.shape[1] != len(net.static.template):
        raise ValueError(f"{path}: truth of {item.truth.shape[1]} vertices, the bundle's garment has "
                         f"{len(net.static.template)}")
    return {level: metrics.summary(positions.double().numpy(), item.truth, faces)
            for level, positions in levels(net, rig, item, path)}


def table(results):
    """Text: one row a clip, E_d mean +- std in mm and E_n in degrees a level."""
    names = list(next(iter(results.values())))
    lines = [f"{'clip':34}" + "".join(f"{name:>26}" for name in names)]
    for clip, row in results.items():
        cells = [f"{row[n]['position_mm']['mean']:6.1f} +- {row[n]['position_mm']['std']:4.1f} mm "
                 f"{row[n]['normal_deg']['mean']:5.1f} deg" for n in names]
        lines.append(f"{clip:34}" + "".join(f"{cell:>26}" for cell in cells))
    return "\n".join(lines)


def write(results, prefix, picture=True):
    """prefix.json, prefix.txt and, unless `picture` is false, prefix.png."""
    with open(prefix + ".json", "w") as file:
        json.dump(results, file, indent=1)
    with open(prefix + ".txt", "w") as file:
        file.write(table(results) + "\n")
    if picture:
        plots.bars({clip: {level: m["position_mm"]["mean"] for level, m in row.items()}
                    for clip, row in results.items()}, prefix + ".png")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bundle")
    parser.add_argument("sequences", nargs="+")
    parser.add_argument("-o", "--output", help="prefix of .json, .txt and .png")
    parser.add_argument("--float64", action="store_true", help="as the reference; half as fast")
    options = parser.parse_args(argv)

    def work():
        if options.output:
            command.folder_of(options.output)
        net, rig, faces, _ = bundle.read(options.bundle,
                                         torch.float64 if options.float64 else torch.float32)
        results = {}
        for path in options.sequences:
            item = sequence.read(path)
            name = path if item.clip in results else item.clip or path
            results[name] = evaluate(net, rig, faces, item, path)
        print(table(results))
        if options.output:
            write(results, options.output)
    return command.ended("evaluate", work)


if __name__ == "__main__":
    sys.exit(main())
