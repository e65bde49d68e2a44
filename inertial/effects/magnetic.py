import numpy as np

from inertial import frames
from inertial.effects.base import AXES, Array, SensorEffect
from inertial.state import State


class Magnetic(SensorEffect):
    """Response to the laboratory's horizontal magnetic field, seen as it turns in the fixture's frame.

    The outer axis lies along the laboratory's x, which the fixture's z therefore never sees: five columns, not six.
    """

    id = "magnetic"
    symbol = "B"
    equation = "Σ bj·(e1·R)j + cj·(e2·R)j"
    source = "mechanism: magnetised proof mass or torquer leakage"
    typical_ug = (1.0, 1000.0)
    hides_behind = ("level_error",)
    breaker = "turn the station, or a coil about it"
    same_on_axes = True
    simplicity = 45

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        outer, inner = state.need("outer", self.id), state.need("inner", self.id)
        north = frames.to_fixture((1.0, 0.0, 0.0), outer, inner)
        east = frames.to_fixture((0.0, 1.0, 0.0), outer, inner)
        return np.concatenate([north[..., :2], east], axis=-1)

    def names(self, axis: int) -> tuple[str, ...]:
        return (*(f"B1{a}" for a in AXES[:2]), *(f"B2{a}" for a in AXES))
