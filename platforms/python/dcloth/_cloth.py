from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _engine
from ._arrays import matrices, output, packed
from ._error import Error
from ._fit import Body, Fit, FitWarning, role_numbers
from ._model import Model, Stages

_AXES = {
    "+x": _engine.AXIS_X, "-x": _engine.AXIS_MINUS_X, "+y": _engine.AXIS_Y, "-y": _engine.AXIS_MINUS_Y,
    "+z": _engine.AXIS_Z, "-z": _engine.AXIS_MINUS_Z,
}


class FrameFlags(enum.IntFlag):
    """How an update spends its time; dcloth.h describes each."""

    PIPELINED = _engine.FRAME_PIPELINED
    """Spreads each tick over the frames until the next one is due."""
    JUMPED = _engine.FRAME_JUMPED
    """The character was moved without motion since the last update."""
    HOLD = _engine.FRAME_HOLD
    """No tick starts in this frame."""
    FREEZE_IDLE = _engine.FRAME_FREEZE_IDLE
    """Stops ticking while the character is idle."""


class Cloth:
    """One garment on one character, with its motion.

    Calls on different cloths may run on different threads at the same time; calls on one cloth wait for each other.
    A call that raises leaves the cloth as it was.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self._cloth = _engine.Cloth(model._model)

    def update(
        self,
        joint_matrices: ArrayLike,
        seconds: float,
        *,
        column_major: bool = False,
        stages: Stages = Stages.MESH,
        flags: FrameFlags = FrameFlags(0),  # noqa: B008 (a number)
        outside_body: bool = False,
        positions: NDArray[np.float32] | None = None,
        normals: NDArray[np.float32] | None = None,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Runs the ticks that are due and draws. Call it once per frame, at any frame rate.

        joint_matrices  [J, 4, 4] float32, joint to world without scale, in the order of `Model.joint_names` or of the
                        names that were bound. A contiguous float32 array is not copied. Do not change it from another
                        thread meanwhile
        seconds         since the last update, 0 or more. The first update after a reset ticks whatever it says
        column_major    the last two axes are swapped: [J, column, row], as in glTF and for matrices on row vectors
        stages          for ticks that start now; stages that the model lacks are ignored
        outside_body    pushes vertices out of the model's body
        positions       writable float32 [vertex_count, 3] that is written; without it a new array is made. Rows may
                        have any distance, so a view of an interleaved vertex buffer works. They are also read: do not
                        give memory that is slow to read
        normals         the same for normals

        Returns positions [vertex_count, 3] in the world, in the host's unit (metres by default), and normals of unit
        length [vertex_count, 3], outward.

        Raises Error: POSE for NaN, infinity or a wrong number of joints, ARGUMENT for arrays of another shape or type.
        """
        n = self.model.vertex_count
        positions = np.empty((n, 3), np.float32) if positions is None else output(positions, "positions")
        normals = np.empty((n, 3), np.float32) if normals is None else output(normals, "normals")
        output_flags = _engine.OUTPUT_OUTSIDE_BODY if outside_body else 0
        self._cloth.update(matrices(joint_matrices, "joint_matrices"), column_major, seconds, int(stages), int(flags),
                           output_flags, positions, normals)
        return positions, normals

    def update_unseen(
        self, joint_matrices: ArrayLike, seconds: float, *, column_major: bool = False, stages: Stages = Stages.MESH,
        flags: FrameFlags = FrameFlags(0),  # noqa: B008 (a number)
    ) -> None:
        """As `update`, for a garment that is not seen: the network moves on, nothing is drawn."""
        self._cloth.update(matrices(joint_matrices, "joint_matrices"), column_major, seconds, int(stages), int(flags),
                           0, None, None)

    def bind_joints(self, names: Sequence[str]) -> None:
        """Finds the model's joints by name among the host's `names`; poses then have one matrix per name.

        Raises Error: JOINTS, with the joints that are missing.
        """
        self._cloth.bind_joints(list(names))

    def set_space(
        self, left: str = "+x", up: str = "+y", forward: str = "+z", metres_per_unit: float = 1.0, *,
        joint_frames_kept: bool = False,
    ) -> None:
        """Chooses the host's axes and unit for poses, outputs and wind.

        left, up, forward  "+x", "-x", "+y", "-y", "+z" or "-z": where these point as the character stands in its bind
                           pose. glTF: +x +y +z. Blender, Panda3D: +x +z -y. Unity: -x +y +z
        metres_per_unit    0.0001 to 1000
        joint_frames_kept  only the world was converted; the joints' own axes are those of training

        Raises Error: ARGUMENT for axes that are no space.
        """
        for axis in (left, up, forward):
            if axis not in _AXES:
                raise Error("ARGUMENT", f"axis: found '{axis}', allowed: {', '.join(_AXES)}")
        self._cloth.set_space(_AXES[left], _AXES[up], _AXES[forward], metres_per_unit, joint_frames_kept)

    def set_bind_pose(self, joint_matrices: ArrayLike, *, column_major: bool = False) -> None:
        """Takes the bind pose of a rig whose joints have axes, positions or a scale of their own.

        joint_matrices  [J, 4, 4] float32 as `update` takes them; the character stands in the stance, and at the
                        place, of the figure of training

        Raises Error: POSE for matrices without inverse or a wrong number of joints.
        """
        self._cloth.set_bind_pose(matrices(joint_matrices, "joint_matrices"), column_major)

    def set_wind(self, wind: ArrayLike) -> None:
        """Sets the velocity of the air relative to the ground for ticks from now on.

        wind  [3] host units per second along the host's axes, at most 100 m/s; ignored unless `Model.reads_wind`

        Raises Error: ARGUMENT.
        """
        self._cloth.set_wind(packed(wind, np.float32, (3,), "wind"))

    def fit(
        self, joint_names: Sequence[str], bind_matrices: ArrayLike, *, column_major: bool = False,
        joint_roles: Mapping[str, str] | None = None, body: Body | None = None,
    ) -> Fit:
        """Fits the garment to a character that it was not trained on. Poses then have one matrix per joint name.

        joint_names    the character's whole skeleton, 1 to 4096 joints
        bind_matrices  [joints, 4, 4] float32, joint to world in a standing T or A pose, any axes and scale
        joint_roles    joint name -> role (`role_names()`), for joints whose names do not tell
        body           the character's skin; with it the cut is moved onto the skin, which takes 0.2 to 0.8 s

        Call `set_space` before. A fitted cloth refuses `set_bind_pose` and `set_space`.

        Raises Error: JOINTS where the skeleton lacks parts that the garment needs; POSE for a bind pose that would
        crumple the garment; ARGUMENT.
        """
        names = list(joint_names)
        arrays: list[Any] = [None] * 4
        if body is not None:
            arrays = [
                packed(body.positions, np.float32, (None, 3), "body.positions"),
                packed(body.joints, np.uint32, (None, None), "body.joints"),
                packed(body.weights, np.float32, (None, None), "body.weights"),
                None if body.triangles is None else packed(body.triangles, np.uint32, (None, 3), "body.triangles"),
            ]
        values = self._cloth.fit(names, matrices(bind_matrices, "bind_matrices"), column_major,
                                 role_numbers(names, joint_roles), *arrays)
        fit = Fit(**values)
        return replace(fit, warnings=FitWarning(fit.warnings))

    def set_fit(self, fit: bytes | bytearray | memoryview) -> None:
        """Lays the garment onto another character, by a file of `dcloth dress HERO -o HERO.dcloth-fit`.

        Poses then have one matrix per joint of that character, in its own order; `bind_joints` after it chooses others.
        Call `set_space` before. A fitted cloth refuses `set_bind_pose` and `set_space`.

        Raises Error: MODEL for the fit of another garment; FORMAT, VERSION or SEMANTICS for damaged bytes.
        """
        self._cloth.set_fit(np.frombuffer(fit, np.uint8))

    def reset(self) -> None:
        """Forgets all motion. Call it after a cut or a spawn."""
        self._cloth.reset()

    def save(self) -> bytes:
        """The state that later frames depend on. Binding, space, bind pose, fit and wind are not in it.

        Raises Error: SEMANTICS where a model's NaN weights have spoiled the state.
        """
        return self._cloth.save()

    def restore(self, state: bytes | bytearray | memoryview, *, other_model: bool = False) -> None:
        """Continues from a saved state, bit for bit on the same instruction set.

        other_model  accepts the state of another file with the same sizes, such as another precision

        Raises Error: FORMAT, VERSION, MODEL or SEMANTICS.
        """
        self._cloth.restore(np.frombuffer(state, np.uint8), other_model)

    @property
    def lag_seconds(self) -> float:
        """How much older the displacement drawn last is than its pose."""
        return self._cloth.describe()[1]

    @property
    def tick_share(self) -> float:
        """Network work of the last update by estimated cost; 1 is a whole tick of all its stages."""
        return self._cloth.describe()[2]

    @property
    def frozen(self) -> bool:
        """Whether FREEZE_IDLE has stopped the ticks."""
        return self._cloth.describe()[3]
