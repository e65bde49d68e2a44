"""Exchange of poses: known optimal plans are found, rivals are parted by the T-criterion, and no exchange is for the worse."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from posed import posed

from inertial import design, poses
from inertial.planning.discrimination import Discrimination
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


MODEL = ("bias", "scale", "misalignment", "third_order", "odd_quadratic")
BASE, CUBIC, ODD = (0, 1, 2, 3), (4,), (5,)
ERROR = 1e-5


def columns(angles):
    return design.local_columns(design.split(MODEL)[0], posed(angles), {})


def discrimination(size=3e-5, wanted=50.0):
    return Discrimination(BASE, (CUBIC, ODD), (np.full((3, 1), size), np.full((3, 1), size)), wanted)


def normal(rows):
    return np.swapaxes(rows, -1, -2) @ rows / ERROR**2


def left_by_the_wrong_one(rows, true, wrong, size=3e-5):
    """Chi-square of a least-squares fit of the wrong effect, with the base, to what the true one adds."""
    fitted = rows[..., [*BASE, *wrong]]
    target = size * rows[..., list(true)].sum(axis=-1)
    rest = [y - h @ np.linalg.lstsq(h, y, rcond=None)[0] for h, y in zip(fitted, target, strict=True)]
    return [float(r @ r) / ERROR**2 for r in rest]


def test_separations_are_what_a_fit_of_the_wrong_rival_leaves():
    rows = columns(poses.plan("fibonacci24"))
    separations = discrimination().separations(normal(rows))
    assert separations[0] == pytest.approx(sum(left_by_the_wrong_one(rows, CUBIC, ODD)), rel=1e-5)
    assert separations[1] == pytest.approx(sum(left_by_the_wrong_one(rows, ODD, CUBIC)), rel=1e-5)
    lot = replace(discrimination(), units=8).separations(normal(rows))
    assert lot == pytest.approx(8.0 * separations)


def test_exchanges_part_rivals_half_as_far_again_as_spread_directions():
    angles = poses.fibonacci(60)
    rows, n = columns(angles), 24
    slots = PlanSlots(
        rows=np.broadcast_to(np.swapaxes(rows, 0, 1)[None], (n, len(angles), 3, rows.shape[-1])).copy(),
        weight=np.eye(n) / ERROR**2,
        travel=np.zeros((len(angles), len(angles))),
        seconds=1000.0,
        group=np.zeros(n, dtype=np.intp),
        fixed=np.zeros(n, dtype=bool),
    )
    start = np.arange(0, 60, 60 / n).astype(np.intp)
    before, after = (
        discrimination().separations(slots.matrix(plan)).min()
        for plan in (start, exchanged(slots, start, discrimination().objective))
    )
    assert after > 1.5 * before


def test_plans_that_do_not_part_the_rivals_or_determine_the_model_say_so():
    assert np.all(discrimination().ratio_to_required(normal(columns(poses.plan("eighteen")))) > 1.0)
    assert discrimination().separations(normal(columns(poses.plan("six")))).max() < 1e-6
    two = columns(np.repeat(poses.plan("six")[:2], 6, axis=0))
    assert np.all(np.isinf(discrimination().ratio_to_required(normal(two))))
