"""A soak that is measured before the elements have the temperature that is read."""

from dataclasses import replace

import numpy as np
import pytest

from inertial.arrays import Array
from inertial.data_errors.handling.soak_too_early import SoakTooEarly
from inertial.estimation.problem import Lot
from inertial.state import History, State

UNITS, POSES, EACH_S = 2, 8, 60.0
SOAKS: Array = np.repeat(np.array([-20.0, 25.0, 70.0]), POSES)
TIME: Array = np.arange(float(SOAKS.size)) * EACH_S + np.repeat([0.0, 3600.0, 7200.0], POSES)
GAPS, TAUS = np.array([-4.0, -3.0]), np.array([150.0, 260.0])  # K, s
SLOPE = 2e-5  # g/K


def lot() -> Lot:
    """Units whose elements begin the second soak colder than their thermometers say."""
    time, temperature = np.tile(TIME, (UNITS, 1)), np.tile(SOAKS, (UNITS, 1))
    force = np.tile(np.eye(3)[np.arange(SOAKS.size) % 3], (UNITS, 1, 1))
    history = History(TIME, temperature.copy())
    state = State(force=force, time=time, temperature=temperature, history=history)
    shape = (UNITS, SOAKS.size, 3)
    return Lot(state, np.zeros(shape), np.full(shape, 1e-6), np.tile(np.eye(3), (UNITS, 1, 1)))


def elements() -> np.ndarray:
    """Their temperatures, (units, n): an exponential, written once more for each unit."""
    truth = np.tile(SOAKS, (UNITS, 1))
    for unit in range(UNITS):
        for dwell in range(POSES, 2 * POSES):
            truth[unit, dwell] += GAPS[unit] * np.exp(-(TIME[dwell] - TIME[POSES]) / TAUS[unit])
    return truth


def test_the_outputs_change_as_by_an_element_that_is_colder_in_that_soak_alone() -> None:
    early, made = SoakTooEarly(), lot()
    slope = np.full((UNITS, SOAKS.size, 3), SLOPE)
    change = early.change(made, slope, soak=1.0, tau=TAUS[0])[0, :, 0, 0] * GAPS[0]
    np.testing.assert_allclose(change, SLOPE * (elements() - SOAKS)[0], atol=1e-12)
    assert early.dwells(made, soak=1.0) == list(range(POSES, 2 * POSES))
    assert "soak 2" in early.describe(made, GAPS[:1], soak=1.0, tau=150.0)


def test_every_unit_has_a_gap_and_a_time_constant_of_its_own_by_its_dwells() -> None:
    early, made, truth = SoakTooEarly(), lot(), elements()

    def misfit(lot: Lot, units: tuple[int, ...], *, own_noise: bool = False) -> float:
        assert lot.state.temperature is not None
        return float(np.sum((lot.state.temperature - truth[list(units)]) ** 2)) * 1e4

    mended = early.settled(made, np.array([-3.5]), misfit, soak=1.0, tau=200.0)
    assert mended is not None
    assert mended.state.temperature is not None
    assert mended.state.history is not None
    np.testing.assert_allclose(mended.state.temperature, truth, atol=0.02)
    np.testing.assert_allclose(mended.state.history.temperature, truth, atol=0.02)


def test_it_needs_two_soaks_and_asks_for_time_constants_that_the_soak_can_show() -> None:
    early, made = SoakTooEarly(), lot()
    places = early.locations(made)
    assert {place["soak"] for place in places} == {0.0, 1.0, 2.0}
    span = (POSES - 1) * EACH_S
    assert all(0.04 * span < place["tau"] < 1.6 * span for place in places)
    still = replace(made, state=replace(made.state, temperature=np.full_like(made.state.time, 25.0), memory={}))
    assert early.locations(still) == []


@pytest.mark.parametrize("soak", [0.0, 2.0])
def test_without_known_coefficients_of_temperature_it_adds_nothing(soak: float) -> None:
    assert not SoakTooEarly().change(lot(), None, soak=soak, tau=100.0).any()
