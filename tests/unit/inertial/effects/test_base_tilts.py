"""A base whose legs follow the temperature of the chamber late, and what they were before the run."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from inertial import frames
from inertial.effects.base_tilts import BaseTilts
from inertial.state import State

TIME = np.linspace(0.0, 30000.0, 61)
WARM = 25.0 + 40.0 * np.sin(TIME / 6000.0)


def late(tau: float, start: float) -> np.ndarray:
    """Temperature of the part at the dwells by an integration of its own, K above the reference."""
    found = solve_ivp(
        lambda t, y: (np.interp(t, TIME, WARM) - y) / tau,
        (0.0, TIME[-1]),
        [start],
        t_eval=TIME,
        rtol=1e-9,
        max_step=50.0,
    )
    return found.y[0] - 25.0


@pytest.mark.parametrize("tau", [300.0, 3600.0])
def test_the_force_changes_with_the_late_temperature_whatever_it_was_before(tau: float) -> None:
    effect = BaseTilts()
    outer, inner = np.random.default_rng(3).uniform(-np.pi, np.pi, (2, TIME.size))
    force = frames.force_from_angles(outer, inner)
    state = State(force=force, time=TIME, temperature=WARM, outer=outer, inner=inner)
    at_once = effect.force_change(State(force, TIME, np.full(TIME.size, 26.0), outer=outer, inner=inner), tau=tau)
    started = effect.start_change(state, tau=tau)
    for start in (WARM[0], -10.0):
        expected = at_once * late(tau, start)[:, None, None]
        found = effect.force_change(state, tau=tau) + (start - WARM[0]) * started
        np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())
