from __future__ import annotations

import enum
import os

import numpy as np
from numpy.typing import NDArray

from . import _engine


class Stages(enum.IntEnum):
    """Which stages of the network run; each needs the ones before it. Fewer are a level of detail."""

    STATIC = _engine.STAGES_STATIC
    SKELETON = _engine.STAGES_SKELETON
    MESH = _engine.STAGES_MESH


class Model:
    """A garment: the checked bytes of a `.dcloth` file, which many cloths may share.

    source  the path of a file, or its bytes (bytes, bytearray, memoryview or a uint8 array). They are copied.

    Raises Error: FORMAT, VERSION or SEMANTICS for bytes that are no whole and sound model; OSError for a file that
    cannot be read.
    """

    def __init__(self, source: str | os.PathLike[str] | bytes | bytearray | memoryview | NDArray[np.uint8]) -> None:
        if isinstance(source, (str, os.PathLike)):
            data = np.fromfile(source, np.uint8)
        else:
            data = np.frombuffer(source, np.uint8)
        self._model = _engine.Model(data)

    @property
    def name(self) -> str:
        """The garment's name."""
        return self._model.name

    @property
    def precision(self) -> str:
        """"fp32", "fp16", "int8" or what the converter was asked for."""
        return self._model.precision

    @property
    def format(self) -> tuple[int, int]:
        """The file format's major and minor version."""
        return self._model.format

    @property
    def stages(self) -> Stages:
        """All stages that the model holds."""
        return Stages(self._model.stages)

    @property
    def tick_seconds(self) -> float:
        """The network's time step in seconds."""
        return self._model.tick_seconds

    @property
    def tick_rate(self) -> float:
        """Ticks per second. `tick_seconds` is a float32; this is rounded to what it can hold."""
        return round(1 / self._model.tick_seconds, 4)

    @property
    def reads_wind(self) -> bool:
        """Whether `Cloth.set_wind` changes the motion of this garment."""
        return self._model.reads_wind

    @property
    def vertex_count(self) -> int:
        return self._model.vertex_count

    @property
    def body_vertex_count(self) -> int:
        """Vertices of the skin that `outside_body` keeps cloth out of; 0 where the model holds no skin."""
        return self._model.body_vertex_count

    @property
    def cloth_bytes(self) -> int:
        """Bytes of memory that one `Cloth` takes."""
        return self._model.cloth_bytes

    @property
    def joint_names(self) -> list[str]:
        """[J] names; a pose has one matrix for each, in this order, unless `Cloth.bind_joints` says otherwise."""
        return self._model.joint_names()

    @property
    def joint_parents(self) -> NDArray[np.int32]:
        """[J] int32: index of the nearest joint above each; -1 at the top, -2 where the file does not say."""
        return np.array(self._model.joint_parents(), np.int32)

    @property
    def joint_binds(self) -> NDArray[np.float32]:
        """[J, 4, 4] float32: joint to world in the bind pose of training, metres, default axes."""
        binds = np.empty((self._model.joint_count, 4, 4), np.float32)
        self._model.joint_binds(binds)
        return binds

    @property
    def positions(self) -> NDArray[np.float32]:
        """[vertex_count, 3] float32, read-only: the garment in the bind pose of training, metres, default axes."""
        return self._model.positions()

    @property
    def triangles(self) -> NDArray[np.uint16]:
        """[c, 3] uint16, read-only: counter-clockwise seen from outside."""
        return self._model.triangles()

    @property
    def texture_coordinates(self) -> NDArray[np.float32]:
        """[d, 2] float32, read-only: u right and v down of the garment's vertices, then of those that `seam_vertices`
        repeats. Empty where the model holds none."""
        return self._model.texture_coordinates()

    @property
    def textured_triangles(self) -> NDArray[np.uint16]:
        """[c, 3] uint16, read-only: the triangles by the d vertices; draw them on
        `np.concatenate([positions, positions[model.seam_vertices]])`."""
        return self._model.textured_triangles()

    @property
    def seam_vertices(self) -> NDArray[np.uint16]:
        """[d - vertex_count] uint16, read-only: the garment's vertex that each of the others repeats."""
        return self._model.seam_vertices()[:, 0]

    def __repr__(self) -> str:
        return (f"<dcloth.Model {self.name!r}, {self.precision}, {self.vertex_count} vertices, "
                f"{len(self.joint_names)} joints, {self.tick_rate:g} Hz>")
