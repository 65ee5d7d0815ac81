"""The training bundle of converter/BUNDLE.md: written from a network, read back into one."""
import json
import os
import sys

import numpy as np
import torch

from . import body_limits, network, safetensors_io, stages
from .features import Standardise
from .rig import Rig

# Rig.root_motion -> metadata "root_motion"; "true" and "false" are older than the choice.
_ROOT_MOTION = {"none": "false", "hips": "true", "air": "air"}


class BundleError(ValueError):
    """A file that is not a bundle as BUNDLE.md describes it."""


class Tensors:
    """A bundle's tensors by name, for stages to read themselves from."""

    def __init__(self, path, tensors):
        self._path, self._tensors = path, tensors

    def error(self, text):
        return BundleError(f"{self._path}: {text}")

    def names(self):
        return list(self._tensors)

    def find(self, name):
        """The array of that name, or None."""
        return self._tensors.get(name)

    def get(self, name):
        """The tensor of that name in float64; a missing one is refused."""
        if name not in self._tensors:
            raise self.error(f"no tensor '{name}'")
        return torch.from_numpy(self._tensors[name].astype(np.float64))

    def fill(self, module, prefix, renamed=lambda name: name, made=None):
        """`module` with its parameters filled; each must be in the bundle, or in made {name: array}, with its shape."""
        with torch.no_grad():
            for name, parameter in module.named_parameters():
                stored = prefix + renamed(name)
                value = (made or {}).get(stored, self.find(stored))
                if value is None or value.shape != tuple(parameter.shape):
                    raise self.error(f"tensor '{stored}': found {None if value is None else list(value.shape)}, "
                                     f"expected {list(parameter.shape)}")
                parameter.copy_(torch.from_numpy(value.astype(np.float64)))
        return module


def _array(value):
    return value.detach().cpu().numpy() if isinstance(value, torch.Tensor) else np.asarray(value)


def _held(net):
    """[(stage's row, its module)] of a network."""
    return [(stage, getattr(net, stage.name)) for stage in stages.up_to(net.last_stage())]


def write(path, net, fitted, character, training, garment=None, half=True):
    """Write one garment, named as the file unless told. Trained weights F16 when `half`, geometry F32, indices I32."""
    rig = fitted.rig
    with np.errstate(over="ignore"):    # an overflow is reported below, by name
        tensors = {f"{stage.name}.{name}": _array(value).astype(np.float16 if half else np.float32)
                   for stage, module in _held(net) for name, value in module.trained().items()}
    if character.texture is not None:    # halves: within a texel of a picture 4,096 wide
        tensors["template.texture_coordinates"] = character.texture.astype(np.float16 if half else np.float32)
    for name, value in tensors.items():
        if not np.isfinite(value).all():
            raise BundleError(f"{path}: tensor '{name}' is not finite as {value.dtype}; "
                              f"train again or export with --float32")
    plain = {"template.positions": character.template, "character.bind": character.bind,
             "body.positions": character.body_vertices,
             "body.joint_weights": character.body_weights}
    if character.body_colours is not None:
        plain["body.colours"] = character.body_colours
    for name in ("mean", "deviation", "low", "high"):
        plain[f"features.{name}"] = getattr(net.standardise, name)
    for _, module in _held(net):
        plain.update(module.given(fitted))
    tensors.update({name: _array(value).astype(np.float32) for name, value in plain.items()})
    if character.collider is not None:
        excess = body_limits.excess(character.body_vertices, character.body_faces, character.collider,
                                    character.template, character.touches, character.body_parts)
        if excess:    # the converter refuses such a body where it is asked for
            print(f"{path}: without body.collides: {excess}", file=sys.stderr)
        else:
            tensors["body.collides"] = np.asarray(character.collider, np.float32)
    if character.touches is not None:
        tensors["template.touches"] = character.touches.astype(np.int32)
        tensors["body.parts"] = character.body_parts.astype(np.int32)
    for _, module in _held(net):
        for name, value in getattr(module, "indices", dict)().items():
            tensors[name] = _array(value).astype(np.int32)
    tensors["template.faces"] = character.faces.astype(np.int32)
    tensors["body.faces"] = character.body_faces.astype(np.int32)
    names = rig.joint_names
    parents = {} if character.parents is None else {"parents": json.dumps([int(p) for p in character.parents])}
    safetensors_io.write(path, tensors, {
        **parents,
        "format": "dcloth-bundle", "format_version": "1",
        "garment": garment or os.path.splitext(os.path.basename(path))[0],
        "tick_rate": f"{rig.rate:g}", "joint_names": json.dumps(list(names)),
        "hips": names[rig.hips],
        "feature_joints": json.dumps([names[j] for j in rig.feature_joints]),
        "root_motion": _ROOT_MOTION[rig.root_motion],
        "bones": json.dumps([names[b] for b in rig.bones]), "training": json.dumps(training)})


def _rig(path, tensors, metadata):
    if metadata.get("format") != "dcloth-bundle" or metadata.get("format_version") != "1":
        raise BundleError(f"{path}: format {metadata.get('format')!r} version "
                          f"{metadata.get('format_version')!r}, expected 'dcloth-bundle' '1'")
    try:
        names = json.loads(metadata["joint_names"])
        kinds = {text: kind for kind, text in _ROOT_MOTION.items()}
        if metadata["root_motion"] not in kinds:
            raise ValueError(f"root_motion {metadata['root_motion']!r}, expected {', '.join(kinds)}")
        return Rig(names, tensors["character.bind"].astype(np.float64),
                   names.index(metadata["hips"]),
                   [names.index(j) for j in json.loads(metadata["feature_joints"])],
                   [names.index(b) for b in json.loads(metadata["bones"])],
                   float(metadata["tick_rate"]), kinds[metadata["root_motion"]])
    except (KeyError, ValueError) as error:
        raise BundleError(f"{path}: metadata or character.bind missing or malformed: "
                          f"{error}") from None


def read(path, dtype=torch.float64):
    """A bundle -> (DCloth in `dtype`, rig, faces [c, 3], metadata)."""
    held, metadata = safetensors_io.read(path)
    rig, tensors = _rig(path, held, metadata), Tensors(path, held)
    if "template.faces" not in held:
        raise tensors.error("no tensor 'template.faces'")
    faces = held["template.faces"]
    standardise = Standardise(*(tensors.get(f"features.{k}") for k in ("mean", "deviation", "low", "high")))
    parts = stages.Parts(tensors.get("template.positions"), faces,
                         torch.from_numpy(rig.bind[rig.bones, :3, 3].copy()), tensors.get("static.initial_weights"),
                         len(standardise.mean))
    modules = {stage.name: stage.kind.of_bundle(tensors, parts) for stage in stages.STAGES}
    return network.DCloth(standardise, **modules).to(dtype), rig, faces, metadata
