"""A coupling that slips under load: where it is looked for, and what it does to the force."""

import numpy as np
import pytest

from inertial import frames
from inertial.data_errors.handling.slips_under_load import SlipsUnderLoad
from inertial.estimation.problem import Lot
from inertial.state import State

OUTER, INNER = np.deg2rad([np.tile([0.0, 30.0, 90.0, -60.0, 180.0, 60.0], 2), np.repeat([0.0, 90.0], 6)])
SLIP = 1e-5


def lot(outer: np.ndarray) -> Lot:
    """Two units at the angles (2, n) or (n,)."""
    outer, inner = (np.broadcast_to(angle, (2, OUTER.size)) for angle in (outer, INNER))
    time = np.broadcast_to(np.arange(float(OUTER.size)), outer.shape)
    state = State(force=frames.force_from_angles(outer, inner), time=time, outer=outer, inner=inner)
    return Lot(state, np.zeros((*outer.shape, 3)), np.full((*outer.shape, 3), 1e-6), np.tile(np.eye(3), (2, 1, 1)))


def test_the_force_changes_as_by_a_table_that_stands_beside_its_reading() -> None:
    slips, made = SlipsUnderLoad(), lot(OUTER)
    (place,) = [p for p in slips.locations(made) if p["side"] > 0.0 and 0.5 < p["load"] < 0.866]
    beyond = np.isin(np.rint(np.rad2deg(OUTER)), [60.0, 90.0])
    assert slips.dwells(made, **place) == np.flatnonzero(beyond).tolist()
    slipped = frames.force_from_angles(OUTER + SLIP * beyond, INNER)
    expected = (slipped - frames.force_from_angles(OUTER, INNER)) / SLIP
    np.testing.assert_allclose(slips.change(made, None, **place)[0, ..., 0], expected, atol=2e-5)
    assert "exceeds" in slips.describe(made, np.array([SLIP]), **place)


@pytest.mark.parametrize("outer", [np.zeros(OUTER.size), np.stack([OUTER, OUTER[::-1]])])
def test_one_load_and_units_at_angles_of_their_own_show_no_slip(outer: np.ndarray) -> None:
    assert SlipsUnderLoad().locations(lot(outer)) == []
