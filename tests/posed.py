"""Dwells in given poses, as the science has them."""

import numpy as np

from inertial.frames import force_from_angles
from inertial.state import State


def posed(degrees: np.ndarray, step: float = 20.0, **columns) -> State:
    """Dwells in poses of these angles (n, 2), ``step`` s apart unless their time is given."""
    outer, inner = np.radians(np.asarray(degrees, dtype=float)).T
    columns = {"time": step * np.arange(outer.size), **columns}
    return State(force=force_from_angles(outer, inner), outer=outer, inner=inner, **columns)
