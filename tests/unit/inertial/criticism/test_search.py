"""Effects that are one function in the poses of a plan share a class, however the noise that units share is estimated."""

import numpy as np
import pytest

from inertial import effects as catalogue
from inertial import poses
from inertial.criticism.field import Candidates
from inertial.criticism.search import judge, ranked
from inertial.estimation.model import Model
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.term import Term
from inertial.frames import force_from_angles
from inertial.state import State

UNITS = 4
PLAIN = [Term(catalogue.get(name)) for name in ("bias", "scale", "misalignment")]


@pytest.mark.parametrize("seed", range(3))
def test_cubic_and_quintic_at_faces_and_edges_are_equal_beside_a_table_that_rests_anew(seed: int) -> None:
    """Components of 0, ±√½ and ±1: beside a scale x³ and x⁵ are one column, and the data cannot prefer either."""
    rng = np.random.default_rng([seed, 18])
    angles = np.radians(np.concatenate([rng.permutation(poses.plan("eighteen")) for _ in range(2)]))
    n = len(angles)
    force = np.broadcast_to(force_from_angles(*angles.T), (UNITS, n, 3))
    # the rest position of the table is common to all units, their own noise is smaller
    noise = 3e-6 * rng.standard_normal((n, 3)) + 2e-6 * rng.standard_normal((UNITS, n, 3))
    time = np.broadcast_to(15.0 * np.arange(n), (UNITS, n))
    error = np.full((UNITS, n, 3), 2e-6)
    lot = Lot(State(force=force, time=time), force + 90e-6 * force**3 + noise, error, np.tile(np.eye(3), (UNITS, 1, 1)))
    problem = Problem(lot)
    model = Model(problem, PLAIN)
    terms = [Term(catalogue.get(name)) for name in ("third_order", "fifth_order")]
    field = Candidates(problem, [t.effect for t in terms], ())
    first, second = ranked([judge(field, model, t) for t in terms])
    assert first.log_p < np.log(1e-6)
    assert second.cost - first.cost < 0.1
