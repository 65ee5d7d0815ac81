"""From a training folder to a bundle, and sequences to their compact form.

    python3 -m dcloth_training.export bundle TRAINING --data DIR -o BUNDLE [--float32]
    python3 -m dcloth_training.export sequence SEQUENCE -o COMPACT
"""
import argparse
import json
import os
import sys

import numpy as np
import torch

from . import assemble, bundle, checkpoint, command, rig, safetensors_io, sequence
from .stages.patch_stage import PatchStage


def root_motion_of(options):
    """Of a training's options; those of before --root-motion knew two kinds."""
    before = "none" if getattr(options, "no_root_motion", False) else "hips"
    return getattr(options, "root_motion", before)


def refuse_another_garment(path, weights, data, fitted):
    """ValueError where skinning weights [n, m] of a network at `path` are not of the garment `fitted` in `data`."""
    there, here = tuple(weights.shape), fitted.initial_weights.shape
    if there != here:
        raise ValueError(f"{path}: a garment of {there[0]} vertices on {there[1]} bones; {data} holds one of {here[0]} "
                         f"on {here[1]}")


def load_trained(folder, data):
    """The finished network of a training folder -> (network, fitted, character, provenance)."""
    path = os.path.join(folder, "network.safetensors")
    saved = checkpoint.load(path)
    if saved is None:
        raise FileNotFoundError(f"{path}: not found; train.py writes it when it ends")
    options = argparse.Namespace(**json.loads(saved["options"]))
    character = rig.read_character(os.path.join(data, "character.safetensors"))
    fitted = rig.fit(character, root_motion=root_motion_of(options))
    refuse_another_garment(path, saved["state"]["static.initial_weights"], data, fitted)
    standard = {k: v.numpy() for k, v in saved["standard"].items()}
    statistics = (torch.zeros(3), torch.ones(3))    # the state holds the real ones
    net = assemble.build(fitted, character, standard, options, statistics, options.stages)
    patch = {name[len("patch."):]: value for name, value in saved["state"].items() if name.startswith("patch.")}
    if patch:
        net.patch = PatchStage.shaped_as(patch)
    net.load_state_dict(saved["state"])
    return net.eval(), fitted, character, json.loads(saved["provenance"])


def compact(item, hips="Hips"):
    """Tensors and metadata of a sequence: truth as F16 about truth_origin, the hips' position."""
    tensors = {"joint_matrices": item.joint_matrices.astype(np.float32)}
    if item.truth is not None:
        names = list(item.joint_names)
        origin = tensors["joint_matrices"][:, names.index(hips) if hips in names else 0, :3, 3].copy()
        tensors["truth"] = (item.truth - origin[:, None]).astype(np.float16)
        tensors["truth_origin"] = origin
    if item.wind is not None:
        tensors["wind"] = np.asarray(item.wind, np.float32)
    return tensors, {"joint_names": json.dumps(list(item.joint_names)), "fps": f"{item.fps:g}",
                     "clip": item.clip, "kind": item.kind}


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    one = verbs.add_parser("bundle")
    one.add_argument("training")
    one.add_argument("--data", required=True)
    one.add_argument("-o", "--output", required=True)
    one.add_argument("--float32", action="store_true", help="trained weights as F32, not F16")
    one.add_argument("--garment", help="its name (default: the bundle's)")
    two = verbs.add_parser("sequence")
    two.add_argument("sequence")
    two.add_argument("-o", "--output", required=True)
    options = parser.parse_args(argv)

    def work():
        command.folder_of(options.output)
        if options.verb == "bundle":
            net, fitted, character, provenance = load_trained(options.training, options.data)
            bundle.write(options.output, net, fitted, character, provenance, options.garment, not options.float32)
        else:
            safetensors_io.write(options.output, *compact(sequence.read(options.sequence)))
        print(f"{options.output}: {os.path.getsize(options.output) / 1e6:.2f} MB", file=sys.stderr)
    return command.ended("export", work)


if __name__ == "__main__":
    sys.exit(main())
