import numpy as np

from inertial.effects.base import AXES, Array, StationEffect
from inertial.state import State


class FixtureBends(StationEffect):
    """Fixture that turns all units as it follows the temperature."""

    id = "fixture_bends"
    symbol = "ρT"
    equation = "f + θ·f×ρT"
    coefficients = tuple(f"rhoT_{axis}" for axis in AXES)
    source = "mechanism: thermal strain of plate and screws"
    typical_ug = (5.0, 2000.0)
    hides_behind = ("misalignment_temperature",)
    breaker = "the same units in other slots, turned by 90°: what turns with the fixture is not theirs"
    simplicity = 9

    def force_change(self, state: State, **nonlinear: float) -> Array:
        theta = state.need("theta", self.id)
        return np.stack([theta[..., None] * np.cross(state.force, way) for way in np.eye(3)], axis=-1)
