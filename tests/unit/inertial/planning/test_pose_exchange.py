"""Exchange of poses: known optimal plans are found, and nothing is exchanged for the worse."""

from itertools import product

import numpy as np
import pytest

from inertial.planning.pose_exchange import CRITERIA, PlanSlots, exchanged, ratios


def line(levels, n, weight=None, travel=None, seconds=1000.0):
    """Slots for a straight line y = a + b·x on three equal axes; the D-optimal plan has half at each end."""
    x = np.asarray(levels, dtype=float)
    rows = np.stack([np.ones_like(x), x], axis=-1)
    c = x.size
    return PlanSlots(
        rows=np.broadcast_to(rows[None, :, None, :], (n, c, 3, 2)).copy(),
        weight=np.eye(n) if weight is None else weight,
        travel=np.zeros((c, c)) if travel is None else travel,
        seconds=seconds,
        group=np.zeros(n, dtype=np.intp),
        fixed=np.zeros(n, dtype=bool),
    )


@pytest.mark.parametrize("criterion", CRITERIA)
def test_a_straight_line_is_measured_at_both_ends(criterion):
    levels = np.linspace(-1.0, 1.0, 9)
    choice = exchanged(line(levels, 8), np.arange(8, dtype=np.intp), criterion)
    assert sorted(levels[choice]) == [-1.0] * 4 + [1.0] * 4


@pytest.mark.parametrize("criterion", CRITERIA)
def test_no_plan_of_five_slots_is_better_than_the_one_found(criterion, rng):
    weight = np.linalg.inv(np.exp(-np.abs(np.subtract.outer(np.arange(5.0), np.arange(5.0))) / 2.0) + 0.2 * np.eye(5))
    slots = line([-1.0, 0.0, 1.0], 5, weight)
    slots.rows[:] = rng.normal(size=(1, 3, 1, 2)) + rng.normal(size=(5, 3, 3, 2)) * 0.1
    value = CRITERIA[criterion]
    best = min(float(value(slots.matrix(np.array(plan)))) for plan in product(range(3), repeat=5))
    starts = [exchanged(slots, rng.integers(0, 3, 5), criterion) for _ in range(6)]
    assert min(float(value(slots.matrix(s))) for s in starts) == pytest.approx(best, abs=1e-9)


def test_slow_wander_makes_the_poses_alternate():
    gap = np.abs(np.subtract.outer(np.arange(12.0), np.arange(12.0)))
    wander = np.linalg.inv(0.01 * np.eye(12) + np.exp(-gap / 50.0))
    blocks = np.repeat([0, 1], 6).astype(np.intp)
    slots = line([-1.0, 1.0], 12, wander)
    choice = exchanged(slots, blocks, "worst")
    assert np.sum(np.diff(choice) != 0) > 6
    assert ratios(slots.matrix(choice))[0, 1] < 0.5 * ratios(slots.matrix(blocks))[0, 1]


def test_long_ways_are_spared_where_they_bring_nothing():
    travel = 300.0 * np.abs(np.subtract.outer(np.arange(2.0), np.arange(2.0)))
    slots = line([-1.0, 1.0], 10, travel=travel, seconds=600.0)
    choice = exchanged(slots, np.array([0, 1] * 5, dtype=np.intp), "worst")
    assert sorted(choice) == [0] * 5 + [1] * 5
    assert np.sum(np.diff(choice) != 0) <= 2


def test_fixed_slots_stay_as_they_are_and_variances_are_those_of_the_whole_plan(rng):
    slots = line(np.linspace(-1.0, 1.0, 5), 6)
    slots.fixed[[0, 5]] = True
    choice = exchanged(slots, np.full(6, 2, dtype=np.intp) + np.array([0, 1, 0, -1, 0, 0]), "D")
    assert (choice[0], choice[5]) == (2, 2)
    slots, choice = line([-1.0, 0.3, 1.0], 7), rng.permutation([0, 1, 2, 0, 1, 2, 0])
    h = slots.rows[np.arange(7), choice][:, 1, :]
    assert ratios(slots.matrix(choice))[1] == pytest.approx(np.sqrt(np.diagonal(np.linalg.inv(h.T @ h))), rel=1e-6)
