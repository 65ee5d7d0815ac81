"""The training bundle of converter/BUNDLE.md: written from a network, read back into one."""
import json
import os
import sys

import numpy as np
import torch

from . import body_limits, geometry, network, safetensors_io
from .features import Standardise
from .rig import Rig
from .stages.mesh_stage import MeshStage
from .stages.skeleton_stage import SkeletonStage
from .stages.static_stage import StaticStage

# Bundle prefix -> prefix in the network's state; names below a prefix are the same in both.
_TRAINED = {"static.mlp.": "static.mlp.", "static.residual_weights": "static.residual_weights",
            "skeleton.basis": "skeleton.basis", "mesh.layers.": "mesh.layers.",
            "mesh.embed.": "mesh.embed.", "mesh.mlp.": "mesh.mlp.", "mesh.basis": "mesh.basis"}
# Directions below this share of a basis' strongest are rounding: they move no vertex by a micrometre.
_SMALLEST_DIRECTION = 1e-6
# Rig.root_motion -> metadata "root_motion"; "true" and "false" are older than the choice.
_ROOT_MOTION = {"none": "false", "hips": "true", "air": "air"}
_GRU = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")


class BundleError(ValueError):
    """A file that is not a bundle as BUNDLE.md describes it."""


def factors(basis):
    """S [k, n, 3] of few directions as readout [k, R] x components [R, n, 3], or None where that saves nothing."""
    flat = np.asarray(basis, np.float64).reshape(len(basis), -1)
    values, vectors = np.linalg.eigh(flat @ flat.T)
    kept = values > _SMALLEST_DIRECTION ** 2 * values[-1]
    rank = int(kept.sum())
    if rank == 0 or rank * sum(flat.shape) >= flat.size:
        return None
    readout = vectors[:, kept][:, ::-1]
    return readout, (readout.T @ flat).reshape(rank, *basis.shape[1:])


def _trained(net):
    """{bundle name: array} of everything that training moved."""
    out = {}
    for name, value in net.state_dict().items():
        if any(name.startswith(prefix) for prefix in _TRAINED.values()):
            out[name] = value.detach().cpu().numpy()
    if net.skeleton is not None:
        for name in _GRU:
            out[f"skeleton.gru.{name}"] = getattr(net.skeleton.gru, name + "_l0").detach().numpy()
        found = factors(out["skeleton.basis"])
        if found:
            del out["skeleton.basis"]
            out["skeleton.readout"], out["skeleton.components"] = found
    return out


def write(path, net, fitted, character, training, garment=None, half=True):
    """Write one garment, named as the file unless told. Trained weights F16 when `half`, geometry F32, indices I32."""
    rig = fitted.rig
    with np.errstate(over="ignore"):    # an overflow is reported below, by name
        tensors = {name: value.astype(np.float16 if half else np.float32)
                   for name, value in _trained(net).items()}
    for name, value in tensors.items():
        if not np.isfinite(value).all():
            raise BundleError(f"{path}: tensor '{name}' is not finite as {value.dtype}; "
                              f"train again or export with --float32")
    plain = {"template.positions": character.template, "character.bind": character.bind,
             "body.positions": character.body_vertices,
             "body.joint_weights": character.body_weights,
             "static.initial_weights": fitted.initial_weights}
    for name in ("mean", "deviation", "low", "high"):
        plain[f"features.{name}"] = getattr(net.standardise, name).numpy()
    if net.mesh is not None:
        plain.update({"nearest.points": fitted.nearest_points,
                      "nearest.joint_weights": fitted.nearest_weights,
                      "mesh.input_mean": net.mesh.input_mean.numpy(),
                      "mesh.input_deviation": net.mesh.input_deviation.numpy()})
    tensors.update({name: np.asarray(value, np.float32) for name, value in plain.items()})
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
    tensors["template.faces"] = character.faces.astype(np.int32)
    tensors["body.faces"] = character.body_faces.astype(np.int32)
    names = rig.joint_names
    safetensors_io.write(path, tensors, {
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


def _load(module, tensors, prefix, renamed=None):
    """Fill the parameters of `module`; every one must be in the bundle with its shape."""
    with torch.no_grad():
        for name, parameter in module.named_parameters():
            stored = prefix + (renamed(name) if renamed else name)
            value = tensors.get(stored)
            if value is None or value.shape != tuple(parameter.shape):
                raise BundleError(f"tensor '{stored}': found "
                                  f"{None if value is None else list(value.shape)}, "
                                  f"expected {list(parameter.shape)}")
            parameter.copy_(torch.from_numpy(value.astype(np.float64)))


def _multiply_factors(path, tensors):
    """skeleton.basis in place of its factors, as the converter does."""
    readout, components = (tensors.pop(f"skeleton.{k}", None) for k in ("readout", "components"))
    if readout is None and components is None:
        return
    if readout is None or components is None or readout.ndim != 2 or components.ndim != 3 \
            or readout.shape[1] != len(components) or "skeleton.basis" in tensors:
        raise BundleError(f"{path}: skeleton.readout and skeleton.components belong together, "
                          f"[k_S, R] and [R, n, 3], without skeleton.basis")
    tensors["skeleton.basis"] = np.tensordot(readout.astype(np.float64), components.astype(np.float64), 1)


def read(path, dtype=torch.float64):
    """A bundle -> (DCloth in `dtype`, rig, faces [c, 3], metadata)."""
    tensors, metadata = safetensors_io.read(path)
    _multiply_factors(path, tensors)
    rig = _rig(path, tensors, metadata)

    def tensor(name):
        if name not in tensors:
            raise BundleError(f"{path}: no tensor '{name}'")
        return torch.from_numpy(tensors[name].astype(np.float64))

    try:
        template, faces = tensor("template.positions"), tensors["template.faces"]
        n, d = len(template), len(tensor("features.mean"))
        standardise = Standardise(*(tensor(f"features.{k}")
                                    for k in ("mean", "deviation", "low", "high")))
        static = StaticStage(template, torch.from_numpy(rig.bind[rig.bones, :3, 3].copy()),
                             tensor("static.initial_weights"), d,
                             len(tensor("static.mlp.0.bias")),
                             len(tensor("static.residual_weights"))).double()
        _load(static, tensors, "static.")
        skeleton = body = mesh = None
        if "skeleton.basis" in tensors:
            skeleton = SkeletonStage(n, d, len(tensors["skeleton.basis"])).double()
            _load(skeleton, tensors, "skeleton.", lambda name: name.replace("_l0", ""))
        if "mesh.basis" in tensors:
            layers = len({k.split(".")[2] for k in tensors if k.startswith("mesh.layers.")})
            mesh = MeshStage(*geometry.padded_neighbours(faces, n), tensor("mesh.input_mean"),
                             tensor("mesh.input_deviation"), tensors["mesh.embed.weight"].shape[1],
                             layers, len(tensors["mesh.mlp.0.bias"]),
                             len(tensors["mesh.basis"])).double()
            _load(mesh, tensors, "mesh.")
            body = network.BodyPoints(tensor("nearest.points"), tensor("nearest.joint_weights"))
    except BundleError as error:
        text = str(error)
        raise BundleError(text if str(path) in text else f"{path}: {text}") from None
    net = network.DCloth(standardise, static, skeleton, body, mesh).to(dtype)
    return net, rig, faces, metadata
