from dataclasses import replace

import numpy as np

from inertial.effects.base import Array, Nonlinear, SensorEffect, stack
from inertial.state import State

_GAPS = 120
"""Gaps between dwells at which a search begins; in a longer run it ends at the best gap near the best of them."""


class StepChange(SensorEffect):
    """Bias that jumps once."""

    id = "step_change"
    symbol = "kS"
    equation = "kS·H(t − t0)"
    coefficients = ("kS",)
    source = "mechanism: stiction released, a shock, a charge trapped"
    typical_ug = (10.0, 10000.0)
    hides_behind = ("aging_linear",)
    breaker = "a reference pose repeated through the run"
    same_on_axes = True
    simplicity = 31
    nonlinear = (Nonlinear("instant", "s", 0.0, 1.0, "linear", 40),)

    def columns(self, state: State, axis: int, *, instant: float, **nonlinear: float) -> Array:
        return stack(state, [(state.time > instant).astype(float)])

    def parameters(self, state: State) -> tuple[Nonlinear, ...]:
        """Instants between the dwells of the run, with dwells on both sides."""
        times = np.unique(state.time)
        between = 0.5 * (times[1:] + times[:-1])[1:-1]
        if between.size < 1:
            return (replace(self.nonlinear[0], choices=(float(np.mean(times)),)),)
        pick = np.unique(np.linspace(0, between.size - 1, min(between.size, _GAPS)).round().astype(int))
        some = tuple(between[pick].tolist())
        return (
            replace(
                self.nonlinear[0],
                low=float(between[0]),
                high=float(between[-1]),
                choices=some,
                every=tuple(between.tolist()) if between.size > pick.size else (),
            ),
        )
