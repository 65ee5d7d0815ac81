"""The PyTorch network on a bundle's stored numbers: what the C++ engine is tested against.

    python3 -m dcloth_training.reference BUNDLE SEQUENCE -o OUT [--stages static|skeleton|mesh]
        [--float32] [--intermediates]

OUT (safetensors): positions [T, n, 3] F32 world metres; with --intermediates also features [T, d]
(standardised, clamped), pivots [T, m, 3], h_S [T, k_S] and Q [T, k_M].
"""
import argparse
import sys

import torch

from . import bundle, command, network, safetensors_io, sequence


def matrices_for(item, rig, path="sequence"):
    """The sequence's matrices in the rig's joint order."""
    missing = [name for name in rig.joint_names if name not in item.joint_names]
    if missing:
        raise ValueError(f"{path}: joints {missing} missing, found {item.joint_names}")
    return item.joint_matrices[:, [item.joint_names.index(n) for n in rig.joint_names]]


def pose_for(item, rig, dtype, path="sequence"):
    """The network's Pose of a sequence, its wind included."""
    return network.pose_of(matrices_for(item, rig, path), rig, dtype, wind=item.wind)


def run(net, rig, matrices, stages=None, intermediates=None, wind=None):
    """Positions [T, n, 3] of joint matrices [T, J, 4, 4] and wind [T, 3] in the network's own dtype."""
    dtype = net.static.template.dtype
    return net.run(network.pose_of(matrices, rig, dtype, wind=wind), stages, intermediates)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bundle")
    parser.add_argument("sequence")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--stages", choices=network.STAGES)
    parser.add_argument("--float32", action="store_true", help="compute in float32, not float64")
    parser.add_argument("--intermediates", action="store_true")
    parser.add_argument("--frames", type=int, help="only the first so many")
    options = parser.parse_args(argv)
    return command.ended("reference", lambda: write(options))


def write(options):
    """OUT of one sequence."""
    command.folder_of(options.output)
    net, rig, _, _ = bundle.read(options.bundle,
                                 torch.float32 if options.float32 else torch.float64)
    item = sequence.read(options.sequence)
    matrices, wind = matrices_for(item, rig, options.sequence), item.wind
    notes = {}
    positions = run(net, rig, matrices[:options.frames], options.stages, notes,
                    None if wind is None else wind[:options.frames])
    out = {"positions": positions.float().numpy()}
    if options.intermediates:
        out.update({name: value.float().numpy() for name, value in notes.items()})
    safetensors_io.write(options.output, out, {"stages": options.stages or net.last_stage()})


if __name__ == "__main__":
    sys.exit(main())
