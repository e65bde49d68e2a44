import numpy as np

from inertial.effects.base import AXES, Array, Nonlinear, StationEffect, late_theta
from inertial.state import State


class FixtureBends(StationEffect):
    """Fixture that turns all units as it follows the temperature, at once or late."""

    id = "fixture_bends"
    symbol = "ρT"
    equation = "f + θ'·f×ρT, τ·dθ'/dt = θ − θ'"
    coefficients = tuple(f"rhoT_{axis}" for axis in AXES)
    source = "mechanism: thermal strain of plate and screws"
    typical_ug = (5.0, 2000.0)
    hides_behind = ("misalignment_temperature",)
    breaker = "the same units in other slots, turned by 90°: what turns with the fixture is not theirs"
    simplicity = 9
    memory = True
    nonlinear = (Nonlinear("tau", "s", 30.0, 20000.0, "log", 4),)

    def force_change(self, state: State, *, tau: float, **nonlinear: float) -> Array:
        return self._turns(state, late_theta(state, tau, self.id))

    def start_change(self, state: State, *, tau: float, **nonlinear: float) -> Array:
        return self._turns(state, np.exp(-(state.time - state.time[..., :1]) / tau))

    def _turns(self, state: State, size: Array) -> Array:
        """Change of force (..., n, 3, 3) by turning about each axis by a size (..., n)."""
        return np.stack([size[..., None] * np.cross(state.force, way) for way in np.eye(3)], axis=-1)
