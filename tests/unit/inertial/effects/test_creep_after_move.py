"""The columns of a creep against its differential equation, for a table that takes its time and for one that takes none."""

import numpy as np
import pytest

from inertial import frames
from inertial.effects.creep_after_move import CreepAfterMove
from inertial.state import State

CREEP = CreepAfterMove()
TAU, WAIT, SPEED = 20.0, 4.0, np.radians(25.0)


def run_of(outer: np.ndarray, inner: np.ndarray) -> State:
    time = 10.0 + 25.0 * np.arange(outer.size)
    return State(
        force=frames.force_from_angles(outer, inner),
        time=time,
        since_move=np.full(outer.size, WAIT),
        outer=outer,
        inner=inner,
    )


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
