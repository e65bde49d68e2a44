"""Groups of a family: a spread between wafers is told from one between lots, and the prior of a unit covers what it is."""

import numpy as np
import pytest

from inertial.errors import NotIdentified
from inertial.population.family import family_of
from inertial.population.groups import groups_of

P, AXES, LOTS, UNITS = 3, 2, 60, 8
MEAN = np.array([5.0, -2.0, 0.3])
UNIT, LOT, WAFER, ERROR = (np.diag(d) for d in ([1.0, 4.0, 0.25], [0.5, 0.0, 0.1], [8.0, 4.0, 0.0], [0.2, 1.0, 0.1]))


def line(rng: np.random.Generator, *, crossed: bool = True, wafers: int = 40) -> tuple[np.ndarray, ...]:
    """Estimates, their covariances, lots, wafers and true values; a wafer's dice go into several lots, or a lot is a wafer."""
    lot = np.repeat(np.arange(LOTS), UNITS)
    wafer = rng.integers(0, wafers, lot.size) if crossed else lot
    drawn = (rng.standard_normal((count, AXES, P)) for count in (lot.size, LOTS, int(wafer.max()) + 1, lot.size))
    own, of_lot, of_wafer, noise = (z @ np.sqrt(c) for z, c in zip(drawn, (UNIT, LOT, WAFER, ERROR), strict=True))
    true = MEAN + own + of_wafer[wafer]
    measured = true + of_lot[lot]
    return measured + noise, np.broadcast_to(ERROR, (*true.shape, P)), lot, wafer, measured


@pytest.mark.slow
def test_wafers_are_told_from_lots_and_priors_cover_new_units() -> None:
    rng, held, better, spreads = np.random.default_rng(21), [], [], []
    for _ in range(6):
        values, error, lot, wafer, truth = line(rng)
        old = lot < LOTS - 10  # the last lots are those to be calibrated
        family = family_of(values[old], error[old], lot[old])
        names = [f"W{k}" for k in wafer]
        groups = groups_of(family, values[old], error[old], lot[old], [n for n, o in zip(names, old, strict=True) if o])
        spreads.append(np.diagonal(groups.spread, axis1=-2, axis2=-1))
        assert np.all(np.diagonal(groups.spread, axis1=-2, axis2=-1)[:, 2] < 0.1)
        for k in np.flatnonzero(~old):
            mean, covariance = groups.of(names[k])
            u = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
            held.append(np.abs(truth[k] - mean) <= 2.0 * u)
            better.append([np.abs(truth[k] - mean)[:, 0], np.abs(truth[k] - family.mean)[:, 0]])
    assert np.mean(spreads, axis=0)[:, :2] == pytest.approx(np.array([[0.75 * 8.0, 0.75 * 4.0]] * 2), rel=0.4)
    assert 0.93 < np.mean(held) < 0.99
    found, without = np.sqrt(np.mean(np.square(better), axis=(0, 2)))
    assert found < 0.6 * without


def test_a_wafer_that_is_a_lot_is_not_told_from_it() -> None:
    values, error, lot, wafer, _ = line(np.random.default_rng(3), crossed=False)
    family = family_of(values, error, lot)
    with pytest.raises(NotIdentified, match="0 groups of the attribute with units in more than one lot, 7 are needed"):
        groups_of(family, values, error, lot, [f"W{k}" for k in wafer])


def test_what_lots_have_in_common_is_no_spread_of_wafers() -> None:
    """Wafers without a spread of their own, dice of each in two lots that follow one another."""
    rng = np.random.default_rng(5)
    lot = np.repeat(np.arange(LOTS), UNITS)
    wafer = (np.arange(lot.size) + UNITS // 2) // UNITS
    of_lot = 3.0 * rng.standard_normal((LOTS, AXES, P))
    values = MEAN + rng.standard_normal((lot.size, AXES, P)) + of_lot[lot]
    error = np.broadcast_to(0.01 * np.eye(P), (*values.shape, P))
    family = family_of(values, error, lot)
    groups = groups_of(family, values, error, lot, [f"W{k}" for k in wafer])
    assert np.all(np.diagonal(groups.spread, axis1=-2, axis2=-1) < 2.0)
    name = f"W{wafer[-1]}"
    mean, covariance = groups.of(name)
    assert np.all(np.abs(mean - family.mean) < 2.0 * np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)))
