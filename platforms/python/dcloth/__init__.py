"""Learned cloth: opens `.dcloth` models, plays them into NumPy arrays, converts and measures training bundles.

Units are metres and seconds. Matrices act on column vectors: the last column of a joint's matrix is its position.
Default axes: +Y is up, the character faces +Z and its left is +X; `Cloth.set_space` changes them.
"""
from ._cloth import Cloth, FrameFlags
from ._engine import isa_name, version
from ._error import Error
from ._fit import Body, Fit, FitWarning, role_names
from ._model import Model, Stages
from ._tool import command_path, convert, evaluate, garments

__all__ = [
    "Body", "Cloth", "Error", "Fit", "FitWarning", "FrameFlags", "Model", "Stages", "__version__", "command_path",
    "convert", "evaluate", "garments", "isa_name", "role_names",
]
__version__ = version()
