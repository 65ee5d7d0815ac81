# Types of the extension module engine.cc.
from typing import Any

import numpy as np
from numpy.typing import NDArray

STAGES_STATIC: int
STAGES_SKELETON: int
STAGES_MESH: int
FRAME_PIPELINED: int
FRAME_JUMPED: int
FRAME_HOLD: int
FRAME_FREEZE_IDLE: int
OUTPUT_OUTSIDE_BODY: int
AXIS_X: int
AXIS_MINUS_X: int
AXIS_Y: int
AXIS_MINUS_Y: int
AXIS_Z: int
AXIS_MINUS_Z: int
FIT_STAND_IN: int
FIT_PROPORTIONS: int
FIT_STANCE: int
FIT_GIRTH: int
FIT_GAP: int
FIT_PENETRATION: int
FIT_FACING: int

def version() -> str: ...
def isa_name() -> str:
    """The instruction set that the engine uses on this processor, for example "avx2"."""

def role_names() -> list[str]: ...

class Model:
    name: str
    precision: str
    joint_count: int
    vertex_count: int
    triangle_count: int
    stages: int
    tick_seconds: float
    format: tuple[int, int]
    reads_wind: bool
    body_vertex_count: int
    cloth_bytes: int
    def __init__(self, bytes: NDArray[np.uint8]) -> None: ...
    def joint_names(self) -> list[str]: ...
    def joint_parents(self) -> list[int]: ...
    def joint_binds(self, out: NDArray[np.float32]) -> None: ...
    def triangles(self) -> NDArray[np.uint16]: ...
    def texture_coordinates(self) -> NDArray[np.float32]: ...
    def textured_triangles(self) -> NDArray[np.uint16]: ...
    def seam_vertices(self) -> NDArray[np.uint16]: ...
    def positions(self) -> NDArray[np.float32]: ...

class Cloth:
    def __init__(self, model: Model) -> None: ...
    def bind_joints(self, names: list[str]) -> None: ...
    def set_space(
        self, left: int, up: int, forward: int, metres_per_unit: float, joint_frames_kept: bool
    ) -> None: ...
    def set_bind_pose(self, joint_matrices: NDArray[np.float32], column_major: bool) -> None: ...
    def set_wind(self, wind: NDArray[np.float32]) -> None: ...
    def fit(
        self,
        names: list[str],
        bind_matrices: NDArray[np.float32],
        column_major: bool,
        roles: list[int],
        body_positions: NDArray[np.float32] | None,
        body_joints: NDArray[np.uint32] | None,
        body_weights: NDArray[np.float32] | None,
        body_triangles: NDArray[np.uint32] | None,
    ) -> dict[str, Any]: ...
    def reset(self) -> None: ...
    def save(self) -> bytes: ...
    def restore(self, state: NDArray[np.uint8], other_model: bool) -> None: ...
    def update(
        self,
        joint_matrices: NDArray[np.float32],
        column_major: bool,
        seconds: float,
        stages: int,
        flags: int,
        output_flags: int,
        positions: NDArray[np.float32] | None,
        normals: NDArray[np.float32] | None,
    ) -> None: ...
    def describe(self) -> tuple[bool, float, float, bool, bool]: ...
