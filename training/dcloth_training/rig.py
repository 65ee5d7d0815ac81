"""The character and garment that training reads, and the rig that the network needs of them."""
import json
from dataclasses import dataclass, field

import numpy as np

from . import geometry, safetensors_io
from .motion import skeleton


@dataclass
class Rig:
    """Which joints mean what; indices into joint_names."""
    joint_names: list
    bind: np.ndarray            # [J, 4, 4]
    hips: int
    feature_joints: list
    bones: list
    rate: float = 30.0
    root_motion: str = "hips"   # one of features.ROOT_NUMBERS


@dataclass
class Character:
    joint_names: list
    joint_mirror: list
    bind: np.ndarray
    body_vertices: np.ndarray   # [b, 3]
    body_faces: np.ndarray
    body_weights: np.ndarray    # [b, J]
    template: np.ndarray        # [n, 3]
    faces: np.ndarray           # [c, 3]
    mirror: np.ndarray          # [n]; None: the garment or the character has no mirror image
    collider: np.ndarray = field(repr=False, default=None)   # [b] bool
    parents: list = None        # [J] joint above each one, -1 at the root; None: not known
    hips: str = "Hips"
    feature_joints: tuple = skeleton.LOWER_BODY
    # Bit masks of parts of the body: cloth touches skin where they share a bit. None: all of the body.
    touches: np.ndarray = field(repr=False, default=None)       # [n]
    body_parts: np.ndarray = field(repr=False, default=None)    # [b]
    body_colours: np.ndarray = field(repr=False, default=None)  # [b, 3] sRGB, 0 to 1, for pictures; None: one for all
    texture: np.ndarray = field(repr=False, default=None)       # [c, 3, 2] u right, v down of the faces' corners


def mirrored_joints(names):
    """Index of the joint that takes each joint's place when left and right swap."""
    def swapped(name):
        return name.replace("Left", "\0").replace("Right", "Left").replace("\0", "Right")
    return [names.index(swapped(name)) for name in names]


def _masks(tensors):
    """(cloth_touches [n], body_parts [b]), or None twice: data sets of before had neither."""
    names = {"cloth_touches": "cloth_template", "body_parts": "body_vertices"}
    if not names.keys() & tensors.keys():
        return None, None
    for name, of in names.items():
        masks, count = tensors[name], len(tensors[of])
        if masks.shape != (count,) or masks.dtype.kind not in "iu" or (masks < 0).any():
            raise ValueError(f"{name}: {masks.dtype} {list(masks.shape)}, allowed is a bit mask from 0 up for each of "
                             f"{count} vertices")
    return tuple(tensors[name] for name in names)


def _texture(tensors):
    """cloth_texture [c, 3, 2], or None: not every garment has one."""
    texture = tensors.get("cloth_texture")
    expected = (*tensors["cloth_faces"].shape, 2)
    if texture is not None and (texture.shape != expected or not np.isfinite(texture).all()):
        raise ValueError(f"cloth_texture: {list(texture.shape)}, allowed are finite numbers {list(expected)}")
    return texture


def read_character(path):
    tensors, metadata = safetensors_io.read(path)
    def check_faces(name, count):
        wrong = tensors[name][(tensors[name] < 0) | (tensors[name] >= count)]
        if len(wrong):
            raise ValueError(f"{name} of vertex {wrong[0]}, allowed 0 to {count - 1}")

    try:
        check_faces("cloth_faces", len(tensors["cloth_template"]))
        check_faces("body_faces", len(tensors["body_vertices"]))
        names = json.loads(metadata["joint_names"])
        weights = tensors["body_weights"].astype(np.float64)
        joint_mirror = None
        if "mirror" in tensors:    # names that say no side, such as Mixamo's, come with the partners themselves
            stored = metadata.get("joint_mirror")
            joint_mirror = mirrored_joints(names) if stored is None else json.loads(stored)
        return Character(
            names, joint_mirror, tensors["joint_bind"].astype(np.float64),
            tensors["body_vertices"], tensors["body_faces"],
            (weights / weights.sum(1, keepdims=True)).astype(np.float32),
            tensors["cloth_template"], tensors["cloth_faces"], tensors.get("mirror"),
            tensors["body_collider"].astype(bool),
            json.loads(metadata["parents"]) if "parents" in metadata else None,
            metadata.get("hips", "Hips"),
            tuple(json.loads(metadata["feature_joints"])) if "feature_joints" in metadata else skeleton.LOWER_BODY,
            *_masks(tensors), tensors.get("body_colours"), _texture(tensors))
    except (KeyError, ValueError) as error:
        raise safetensors_io.SafetensorsError(
            f"{path}: not a character: {error}; expected what simulate/run.py writes") from None


@dataclass
class Fit:
    """The garment on the body by the nearest-point rule, float32."""
    rig: Rig
    nearest_points: np.ndarray      # [n, 3]
    nearest_weights: np.ndarray     # [n, J]
    initial_weights: np.ndarray     # [n, m] W_I


def fit(character, hips=None, feature_joints=None, root_motion="hips", rate=30.0, threshold=0.05):
    """Nearest points on the collider part of the skin, cloth bones and W_I."""
    names, hips = character.joint_names, hips or character.hips
    feature_joints = feature_joints or character.feature_joints
    missing = [j for j in dict.fromkeys((hips, *feature_joints)) if j not in names]
    if missing:
        raise ValueError(f"joints {', '.join(missing)} not in the character, which has {', '.join(names)}; its "
                         f"\"hips\" and \"feature_joints\" say which are meant")
    points, weights = geometry.nearest_weights(
        character.template, character.body_vertices, character.body_faces,
        character.body_weights, character.collider)
    bones, initial = geometry.choose_bones(weights, threshold)
    rig = Rig(names, character.bind, names.index(hips), [names.index(j) for j in feature_joints],
              [int(b) for b in bones], rate, root_motion)
    return Fit(rig, points.astype(np.float32), weights.astype(np.float32),
               initial.astype(np.float32))
