"""Effects with memory against differential equations and small steps: late base, creep, dry friction, play of a die attach."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from inertial import frames
from inertial.design import carried_over
from inertial.effects.base_tilts import BaseTilts
from inertial.effects.creep_after_move import CreepAfterMove
from inertial.effects.pose_hysteresis import FROM_POSE, ON_THE_WAY, PoseHysteresis
from inertial.effects.thermal_hysteresis import ThermalHysteresis
from inertial.state import State

TIME = np.linspace(0.0, 30000.0, 61)
WARM = 25.0 + 40.0 * np.sin(TIME / 6000.0)


def late(tau: float, start: float) -> np.ndarray:
    """Temperature of the part at the dwells by an integration of its own, K above the reference."""

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return (np.interp(t, TIME, WARM) - y) / tau

    return solve_ivp(rate, (0.0, TIME[-1]), [start], t_eval=TIME, rtol=1e-9, max_step=50.0).y[0] - 25.0


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


CREEP = CreepAfterMove()
TAU, WAIT, SPEED = 20.0, 4.0, np.radians(25.0)


def run_of(outer: np.ndarray, inner: np.ndarray) -> State:
    time, wait = 10.0 + 25.0 * np.arange(outer.size), np.full(outer.size, WAIT)
    return State(frames.force_from_angles(outer, inner), time, since_move=wait, outer=outer, inner=inner)


def missing(state: State, angles: np.ndarray, *, way: bool) -> np.ndarray:
    """What a strain that follows the force with TAU still misses at each dwell, by steps of 5 ms; (n, 3), g."""
    step, fine = 0.005, np.arange(0.0, float(state.time[-1]) + 0.005, 0.005)
    at = np.repeat(angles[:1], fine.size, axis=0)
    for k in range(1, len(angles)):
        ends = float(state.time[k]) - WAIT
        turn = angles[k] - angles[k - 1]
        begins = ends - (np.max(np.abs(turn)) / SPEED if way else 0.0)
        part = np.clip((fine - begins) / max(ends - begins, 1e-9), 0.0, 1.0)
        at = at + part[:, None] * turn
    force, left = frames.force_from_angles(at[:, 0], at[:, 1]), np.zeros(3)
    every = np.empty_like(force)
    for i, f in enumerate(force):
        left = (left + f - (force[i - 1] if i else f)) * np.exp(-step / TAU)
        every[i] = left
    return np.stack([np.interp(state.time, fine, every[:, axis]) for axis in range(3)], axis=-1)


@pytest.mark.parametrize("way", [0.0, 1.0])
def test_a_creep_is_what_a_strain_behind_the_force_misses(way: float) -> None:
    rng = np.random.default_rng(5)
    angles = rng.uniform(-np.pi, np.pi, (12, 2)) / 1.2
    state = run_of(angles[:, 0], angles[:, 1])
    columns = np.stack([CREEP.columns(state, axis, tau=TAU, way=way)[..., 0] for axis in range(3)], axis=-1)
    true = missing(state, angles, way=bool(way))
    assert np.abs(columns - true).max() < 0.01 * np.abs(true).max()


def test_without_the_way_or_recorded_angles_a_move_takes_no_time() -> None:
    state = run_of(np.radians([0.0, 90.0, 180.0, 90.0]), np.radians([0.0, 90.0, 0.0, -90.0]))
    still = CREEP.columns(state, 1, tau=TAU, way=0.0)
    bare = State(force=state.force, time=state.time, since_move=state.since_move)
    assert np.array_equal(CREEP.columns(state, 1, tau=TAU), still)
    assert np.array_equal(CREEP.columns(bare, 1, tau=TAU, way=1.0), CREEP.columns(bare, 1, tau=TAU, way=0.0))


WIDTH = 0.3
FINE = 2000  # instants of one move


def angles(count: int) -> np.ndarray:
    """Poses (2, count), rad, of a table that turns over the top on the way."""
    return np.random.default_rng(7).uniform(-np.pi, np.pi, (2, count))


def dragged(turns: np.ndarray, axis: int) -> np.ndarray:
    """What the force (…) holds in friction at each pose, in half widths, by small steps of both axes at once."""
    held, out = 0.0, []
    before = turns[:, 0]
    for pose in turns.T:
        way = before[:, None] + np.linspace(0.0, 1.0, FINE) * (pose - before)[:, None]
        for force in frames.force_from_angles(*way)[:, axis].tolist():
            held = min(max(held, force - WIDTH), force + WIDTH)
        out.append((frames.force_from_angles(*pose)[axis] - held) / WIDTH)
        before = pose
    return np.array(out)


@pytest.mark.parametrize("kept", [FROM_POSE, ON_THE_WAY])
def test_the_side_from_which_the_first_pose_was_reached_is_open(kept: float) -> None:
    turns = angles(25)
    poses = frames.force_from_angles(*turns)
    state = State(force=poses, time=np.arange(25.0), outer=turns[0], inner=turns[1])
    home = np.concatenate([np.zeros((2, 1)), turns], axis=1)
    whole = State(force=frames.force_from_angles(*home), time=np.arange(26.0), outer=home[0], inner=home[1])
    effect = PoseHysteresis()
    for axis in range(3):
        known = effect.columns(whole, axis, half_width=WIDTH, kept=kept)[1:, 0]
        assumed = effect.columns(state, axis, half_width=WIDTH, kept=kept)[:, 0]
        start = effect.start_columns(state, axis, half_width=WIDTH, kept=kept)[:, 0]
        assert start[0] == 1.0
        np.testing.assert_allclose(known, assumed + (known - assumed)[0] * start, atol=0.02)


@pytest.mark.parametrize("turned", [np.eye(3), np.roll(np.eye(3), 1, axis=0)])
def test_the_side_follows_the_force_over_the_way(turned: np.ndarray) -> None:
    turns = angles(25)
    force = 0.9995 * frames.force_from_angles(*turns) @ turned.T
    state = State(force=force, time=np.arange(25.0), outer=turns[0], inner=turns[1])
    for axis in range(3):
        own = int(np.argmax(turned[axis]))  # the fixture's axis that the sensor's axis lies along
        column = PoseHysteresis().columns(state, axis, half_width=WIDTH, kept=ON_THE_WAY)[:, 0]
        np.testing.assert_allclose(column, dragged(turns, own), atol=0.02)
        only_poses = PoseHysteresis().columns(state, axis, half_width=WIDTH, kept=FROM_POSE)[:, 0]
        assert np.abs(only_poses - column).max() > 0.5  # the way is not nothing


def test_units_of_a_table_have_its_way_and_units_turned_by_hand_have_none() -> None:
    turns = angles(12)
    force = frames.force_from_angles(*turns)
    one = State(force=force, time=np.arange(12.0), outer=turns[0], inner=turns[1])
    alike = [np.broadcast_to(values, (3, *values.shape)) for values in (force, one.time, *turns)]
    lot = State(force=alike[0], time=alike[1], outer=alike[2], inner=alike[3])
    assert one.way is not None
    assert lot.way is not None
    np.testing.assert_array_equal(lot.way[2], one.way)
    for state in (
        State(force=force, time=one.time),
        State(force=force[::-1], time=one.time, outer=turns[0], inner=turns[1]),
    ):
        assert state.way is None
        from_pose = PoseHysteresis().columns(state, 0, half_width=WIDTH, kept=FROM_POSE)
        np.testing.assert_array_equal(PoseHysteresis().columns(state, 0, half_width=WIDTH, kept=ON_THE_WAY), from_pose)


def test_poses_in_a_plane_have_the_way_that_the_table_takes_out_of_it() -> None:
    outer, inner = np.deg2rad([[0.0, 90.0, 180.0, 90.0], [0.0, 90.0, 0.0, -90.0]])
    force = frames.force_from_angles(outer, inner)
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for own in (np.eye(3), turned):
        way = State(force=force @ own.T, time=np.arange(4.0), outer=outer, inner=inner).way
        assert way is not None
        assert np.abs(way @ own)[..., 1].max() == pytest.approx(0.5, abs=0.01)  # at (45, 45) degrees


def test_poses_in_one_line_tell_no_way_of_a_unit_with_directions_of_its_own() -> None:
    outer = np.array([0.0, np.pi, 0.0])
    force = frames.force_from_angles(outer, np.zeros(3))
    known = State(force=force, time=np.arange(3.0), outer=outer, inner=np.zeros(3))
    assert known.way is not None
    assert np.abs(known.way[..., 1]).max() == pytest.approx(1.0)
    turned = State(force=np.roll(force, 1, axis=1), time=np.arange(3.0), outer=outer, inner=np.zeros(3))
    assert turned.way is None
    assert PoseHysteresis().parameters(turned)[1].choices == (0.0, 1.0)


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
