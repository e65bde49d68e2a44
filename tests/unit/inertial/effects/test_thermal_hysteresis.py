"""The play of a die attach against dry friction that remembers what was before the run."""

import numpy as np

from inertial.design import carried_over
from inertial.effects.thermal_hysteresis import ThermalHysteresis
from inertial.state import State

SLIPS = 8.0


def strain(temperature: np.ndarray, before: float) -> np.ndarray:
    """Mismatch that a layer holds which slipped last at ``before`` °C, in kelvin of temperature."""
    held, out = before, np.empty(temperature.size)
    for k, warm in enumerate(temperature):
        held = min(max(held, warm - SLIPS), warm + SLIPS)
        out[k] = warm - held
    return out


def test_a_run_that_begins_at_the_edge_of_the_play_has_the_columns_of_its_start() -> None:
    temperature = 25.0 + 20.0 * np.sin(np.linspace(0.0, 7.0, 40))
    state = State(force=np.tile([0.0, 0.0, 1.0], (40, 1)), time=np.arange(40.0), temperature=temperature)
    for before, start in ((5.0, 1.0), (25.0, 0.0), (21.0, 0.5), (60.0, -1.0)):
        column = ThermalHysteresis().columns(state, 2, half_width=SLIPS, start=start)[:, 0]
        np.testing.assert_allclose(SLIPS * column, strain(temperature, before), atol=1e-9)


def test_another_run_begins_at_rest() -> None:
    values = {"thermal_hysteresis": {"half_width": 8.0, "start": -0.7}, "thermal_lag": {"tau": 90.0}}
    assert carried_over(values) == {"thermal_hysteresis": {"half_width": 8.0}, "thermal_lag": {"tau": 90.0}}
    state = State(force=np.tile([0.0, 0.0, 1.0], (3, 1)), time=np.arange(3.0), temperature=np.array([25.0, 26.0, 25.5]))
    assert ThermalHysteresis().columns(state, 0, half_width=8.0)[0, 0] == 0.0
