from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

from . import _engine
from ._error import Error


class FitWarning(enum.IntFlag):
    """Why a fit may not look right (dcloth_fit.h)."""

    STAND_IN = _engine.FIT_STAND_IN
    PROPORTIONS = _engine.FIT_PROPORTIONS
    STANCE = _engine.FIT_STANCE
    GIRTH = _engine.FIT_GIRTH
    GAP = _engine.FIT_GAP
    PENETRATION = _engine.FIT_PENETRATION
    FACING = _engine.FIT_FACING


@dataclass(frozen=True)
class Body:
    """A character's skin in its bind pose, in the host's space."""

    positions: ArrayLike
    """[b, 3] float32, world."""
    joints: ArrayLike
    """[b, k] uint32: indices of the character's joints, k from 1 to 16."""
    weights: ArrayLike
    """[b, k] float32, 0 or more."""
    triangles: ArrayLike | None = None
    """[c, 3] uint32; without them the points must lie close to each other."""


@dataclass(frozen=True)
class Fit:
    """How a garment fits a character. Ratios compare with the figure of training; see dcloth_fit.h."""

    warnings: FitWarning
    scale: float
    """The garment is drawn this many times the size it was trained at."""
    bone_scale: float
    waist_ratio: float
    """0 without a body."""
    hips_ratio: float
    """0 without a body."""
    gap_mm: float
    penetration_mm: float
    penetrating_share: float
    stance_degrees: float
    stance_role: str
    stand_in_role: str
    ratios: dict[str, float]
    """By role: the bone from this joint to the next over the scaled figure's; unknown ones are absent."""
    joints: dict[str, int]
    """By role: the index of the character's joint; roles without a joint are absent."""


def role_names() -> list[str]:
    """The parts of a body that joints move: "hips", "left upper leg" and so on."""
    return _engine.role_names()[1:]


def role_numbers(joint_names: Sequence[str], joint_roles: Mapping[str, str] | None) -> list[int]:
    """The engine's number for each joint; 0 leaves the joint's role to its name."""
    if joint_roles is None:
        return []
    names = _engine.role_names()
    for joint, role in joint_roles.items():
        if role not in names or joint not in joint_names:
            what = f"role '{role}'" if role not in names else f"joint '{joint}', which is not in joint_names"
            raise Error("ARGUMENT", f"joint_roles: found {what}, allowed: joints of joint_names, and the roles "
                        f"{', '.join(names[1:])}")
    return [names.index(joint_roles.get(joint, names[0])) for joint in joint_names]
