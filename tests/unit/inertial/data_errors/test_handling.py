"""Errors of handling: dwells that began before the table stood, a coupling that slips under load, soaks measured too early."""

from dataclasses import replace

import numpy as np
import pytest
from made_worlds import BASE, World, lot_in, make

from inertial import frames
from inertial.arrays import Array
from inertial.criticism.diagnosis import diagnose
from inertial.data_errors.handling.slips_under_load import SlipsUnderLoad
from inertial.data_errors.handling.soak_too_early import SoakTooEarly
from inertial.estimation.problem import Lot
from inertial.frames import force_from_angles
from inertial.state import History, State

DWELLS = (9, 28)


@pytest.mark.parametrize(("share_of", "name"), [("the pose before", "dwell_too_early"), ("the way", "wrong_pose")])
def test_dwells_that_began_too_early_are_told_and_nothing_else(share_of: str, name: str) -> None:
    """They were told as jumps of single axes: a mean that is shorter than gravity is no tilt."""
    lot = lot_in(make(World(units=4, poses=18, soaks=(25.0, 60.0)), 31))
    output = np.array(lot.output)
    for k in DWELLS:
        if share_of == "the pose before":
            output[:, k] += 5e-4 * (output[:, k - 1] - output[:, k])
            continue
        angles = (np.broadcast_to(angle, output.shape[:2]) for angle in (lot.state.outer, lot.state.inner))
        (a, b), (c, d) = (np.unwrap(angle[0, k - 1 : k + 1]) for angle in angles)
        part = np.linspace(0.7, 1.0, 100)  # the table turns at a constant rate, both axes at once
        way = force_from_angles(a + part * (b - a), c + part * (d - c)).mean(axis=0) - force_from_angles(b, d)
        output[:, k] += 6e-4 * way / np.linalg.norm(way)
    found = diagnose(replace(lot, output=output), BASE, np.random.default_rng(2))
    assert sorted(d for named in found.handled for d in named.dwells) == sorted(DWELLS)
    assert {named.effects.ids[0] for named in found.handled} == {name}
    assert (found.named, found.removed, found.unexplained) == ((), (), None)


OUTERS, INNERS = np.deg2rad([np.tile([0.0, 30.0, 90.0, -60.0, 180.0, 60.0], 2), np.repeat([0.0, 90.0], 6)])
SLIP = 1e-5


def at_angles(outer: np.ndarray) -> Lot:
    """Two units at the angles (2, n) or (n,)."""
    outer, inner = (np.broadcast_to(angle, (2, OUTERS.size)) for angle in (outer, INNERS))
    time = np.broadcast_to(np.arange(float(OUTERS.size)), outer.shape)
    state = State(force=frames.force_from_angles(outer, inner), time=time, outer=outer, inner=inner)
    return Lot(state, np.zeros((*outer.shape, 3)), np.full((*outer.shape, 3), 1e-6), np.tile(np.eye(3), (2, 1, 1)))


def test_the_force_changes_as_by_a_table_that_stands_beside_its_reading() -> None:
    slips, made = SlipsUnderLoad(), at_angles(OUTERS)
    (place,) = [p for p in slips.locations(made) if p["side"] > 0.0 and 0.5 < p["load"] < 0.866]
    beyond = np.isin(np.rint(np.rad2deg(OUTERS)), [60.0, 90.0])
    assert slips.dwells(made, **place) == np.flatnonzero(beyond).tolist()
    slipped = frames.force_from_angles(OUTERS + SLIP * beyond, INNERS)
    expected = (slipped - frames.force_from_angles(OUTERS, INNERS)) / SLIP
    np.testing.assert_allclose(slips.change(made, None, **place)[0, ..., 0], expected, atol=2e-5)
    assert "exceeds" in slips.describe(made, np.array([SLIP]), **place)


@pytest.mark.parametrize("outer", [np.zeros(OUTERS.size), np.stack([OUTERS, OUTERS[::-1]])])
def test_one_load_and_units_at_angles_of_their_own_show_no_slip(outer: np.ndarray) -> None:
    assert SlipsUnderLoad().locations(at_angles(outer)) == []


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
    """Their temperatures, (units, n): an exponential of the second soak."""
    since = TIME - TIME[POSES]
    return SOAKS + GAPS[:, None] * np.exp(-since / TAUS[:, None]) * (SOAKS[POSES] == SOAKS)


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
