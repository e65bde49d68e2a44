"""T-criterion: the chi-square between rivals is what a fit of the wrong one leaves, and exchanges raise it."""

from dataclasses import replace

import numpy as np
import pytest
from posed import posed

from inertial import design, poses
from inertial.planning.discrimination import Discrimination
from inertial.planning.pose_exchange import PlanSlots, exchanged

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
