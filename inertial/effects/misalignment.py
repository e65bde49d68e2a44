from collections.abc import Mapping

import numpy as np

from inertial.effects.base import AXES, Array, SensorEffect, others, stack
from inertial.frames import unseen_directions
from inertial.state import ALL_AXES, State


class Misalignment(SensorEffect):
    """Response to specific force across the sensor's axis: axes that are not square, and the mounting's rotation."""

    id = "misalignment"
    symbol = "δ"
    equation = "δj·fj + δk·fk"
    source = "IEEE Std 1293-1998, model equation"
    typical_ug = (1000.0, 10000.0)
    hides_behind = ("slot_rotation",)
    breaker = "take the device off, turn it and mount it again; or report the symmetric part only"
    simplicity = 2

    def constants(self, state: State) -> Mapping[str, float]:
        """Zero for each direction across that the poses of a device with one axis or two do not show."""
        unseen = unseen_directions(state.force) if len(state.axes) < len(ALL_AXES) else ()
        across = {direction for axis in state.axes for direction in others(axis)}
        return {AXES[direction]: 0.0 for direction in unseen if direction in across}

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        shown = [state.force[..., k] for k in others(axis) if AXES[k] not in nonlinear]
        return stack(state, shown) if shown else np.zeros((*state.force.shape[:-1], 2))

    def names(self, axis: int) -> tuple[str, ...]:
        return tuple(f"K{AXES[axis]}{AXES[k]}" for k in others(axis))

    def names_at(self, axis: int, **nonlinear: float) -> tuple[str, ...]:
        shown = [k for k in others(axis) if AXES[k] not in nonlinear]
        return tuple(f"K{AXES[axis]}{AXES[k]}" for k in shown or others(axis))
