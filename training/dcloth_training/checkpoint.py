"""Checkpoints as safetensors: written whole or not at all, no code in the file to run.

The state is any nest of dicts, lists and tuples over tensors and JSON scalars. Tensors become the
file's tensors in order of appearance, the nest becomes one JSON string in the metadata.
"""
import json
import os

import torch

from . import safetensors_io


def _flatten(value, tensors):
    if isinstance(value, torch.Tensor):
        tensors.append(value.detach().cpu().numpy())
        return {"tensor": len(tensors) - 1}
    if isinstance(value, dict):
        return {"dict": [[key, _flatten(item, tensors)] for key, item in value.items()]}
    if isinstance(value, (list, tuple)):
        return {type(value).__name__: [_flatten(item, tensors) for item in value]}
    if value is None or isinstance(value, (bool, int, float, str)):
        return {"is": value}
    raise TypeError(f"a checkpoint cannot hold a {type(value).__name__}")


def _restore(node, tensors):
    (kind, value), = node.items()
    if kind == "tensor":
        return torch.from_numpy(tensors[str(value)])
    if kind == "dict":
        return {key: _restore(item, tensors) for key, item in value}
    if kind in ("list", "tuple"):
        items = [_restore(item, tensors) for item in value]
        return tuple(items) if kind == "tuple" else items
    return value


def save(path, state):
    tensors = []
    tree = _flatten(state, tensors)
    safetensors_io.write(path, {str(i): t for i, t in enumerate(tensors)},
                         {"format": "dcloth-checkpoint", "tree": json.dumps(tree)})


def load(path):
    """The saved state, or None where there is no such file."""
    if not os.path.exists(path):
        return None
    tensors, metadata = safetensors_io.read(path)
    if metadata.get("format") != "dcloth-checkpoint":
        raise safetensors_io.SafetensorsError(f"{path}: not a checkpoint of this trainer")
    return _restore(json.loads(metadata["tree"]), tensors)
