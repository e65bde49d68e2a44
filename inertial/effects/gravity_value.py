from inertial.effects.base import Array, StationEffect
from inertial.state import State


class GravityValue(StationEffect):
    """Local gravity other than the recipe says."""

    id = "gravity_value"
    symbol = "ε"
    equation = "f·(1 + ε)"
    coefficients = ("gravity",)
    source = "pole to equator 5300 ppm; identical with the scale factor"
    typical_ug = (1.0, 5300.0)
    hides_behind = ("scale",)
    breaker = "a surveyed value of gravity"
    simplicity = 37

    def force_change(self, state: State, **nonlinear: float) -> Array:
        return state.force[..., None]
