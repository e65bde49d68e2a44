"""Dry friction that a force drags along, over all the way of the table from pose to pose."""

import numpy as np
import pytest

from inertial import frames
from inertial.effects.pose_hysteresis import FROM_POSE, ON_THE_WAY, PoseHysteresis
from inertial.state import State

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
