"""What plans can see, against a published table: the part v of each term left after bias, scale and misalignment.

Computed for sensor axis x; the plans are symmetric, so every axis must show the same to two digits (one for the lattice).
"""

import numpy as np
import pytest

from inertial import effects, frames, planning, poses
from inertial.state import State

COLUMNS = (
    ("second_order", 0), ("cross_axis_quadratic", 0), ("cross_coupling", 0), ("cross_axis_quadratic", 2),
    ("third_order", 0), ("odd_quadratic", 0), ("scale_asymmetry", 0), ("bias_asymmetry", 0),
)  # fmt: skip
TABLE = {
    "six": (0.82, 0.82, 0, 0, 0, 0, 0.82, 0),
    "orthogonal24": (0.82, 0.82, 0, 0, 0, 0, 0.82, 0),
    "twelve": (0.58, 0.58, 1, 1, 0, 0, 0.58, 0),
    "eighteen": (0.71, 0.71, 1, 1, 0.33, 0.17, 0.68, 0.15),
    "twenty_six": (0.64, 0.64, 1, 1, 0.40, 0.21, 0.58, 0.18),
    "fibonacci24": (0.66, 0.67, 1, 1, 0.41, 0.25, 0.49, 0.47),
}
RANKS = {"six": (6, 6, 6), "orthogonal24": (6, 6, 6), "twelve": (9, 12, 12), "eighteen": (9, 15, 18),
         "twenty_six": (9, 16, 22), "fibonacci24": (9, 16, 24)}  # fmt: skip


def planned(name):
    angles = np.radians(poses.plan(name))
    return State(
        force=frames.force_from_angles(angles[:, 0], angles[:, 1]),
        time=30.0 * np.arange(len(angles)),
        temperature=np.full(len(angles), 25.0),
        outer=angles[:, 0],
        inner=angles[:, 1],
    )


@pytest.mark.parametrize("name", TABLE)
def test_the_table_of_identifiability_is_reproduced(name):
    state = planned(name)
    for axis in range(3):
        base = np.concatenate([np.ones((len(state.time), 1)), state.force], axis=1)
        span = np.linalg.svd(base, full_matrices=False)[0]
        for (effect, column), expected in zip(COLUMNS, TABLE[name], strict=True):
            sharp = {"transition": 1e-5} if effect == "bias_asymmetry" else {}
            values = effects.get(effect).columns(state, axis, **sharp)[:, column]
            if np.linalg.norm(values) < 1e-9:
                assert expected == 0
                continue
            left = np.linalg.norm(values - span @ (span.T @ values)) / np.linalg.norm(values)
            assert left == pytest.approx(expected, abs=0.006 if axis == 0 else 0.035)


@pytest.mark.parametrize("name", RANKS)
def test_the_ranks_of_polynomials_on_the_sphere_are_reproduced(name):
    force = planned(name).force
    for degree, expected in zip((2, 3, 4), RANKS[name], strict=True):
        powers = [
            (a, b, c)
            for a in range(degree + 1)
            for b in range(degree + 1)
            for c in range(degree + 1)
            if a + b + c <= degree
        ]
        terms = np.stack([np.prod(force ** np.array(p), axis=1) for p in powers], axis=1)
        assert np.linalg.matrix_rank(terms, tol=1e-8) == expected


def test_faces_cannot_see_cross_coupling_and_say_what_to_add():
    sight = {s.effect: s for s in planning.sights(planned("six"), ("bias", "scale", "misalignment"), 1e-5)}
    assert not sight["cross_coupling"].seen
    assert "45" in sight["cross_coupling"].breaker or "90°" in sight["cross_coupling"].breaker
    assert sight["second_order"].seen
    assert {"scale_asymmetry", "fourth_order"} <= set(sight["second_order"].alias)


def test_the_floor_of_the_second_order_term_is_the_published_one():
    sight = {s.effect: s for s in planning.sights(planned("six"), ("bias", "scale", "misalignment"), 11.4e-6)}
    assert 1e6 * sight["second_order"].floor == pytest.approx(30.0, abs=1.0)
    sight = {s.effect: s for s in planning.sights(planned("twenty_six"), ("bias", "scale", "misalignment"), 11.4e-6)}
    assert 1e6 * sight["third_order"].floor == pytest.approx(47.0, abs=2.0)
