"""Families of calibrated units and their groups: spreads without the errors of the calibrations, wafers apart from lots."""

import numpy as np
import pytest
from long_suites import mostly_slow

from inertial.errors import NotIdentified
from inertial.population.family import Family, change_of, family_of
from inertial.population.groups import groups_of

P, AXES = 3, 2
MEAN = np.array([5.0, -2.0, 0.3])
WITHIN, BETWEEN, ERROR = np.diag([9.0, 4.0, 0.25]), np.diag([2.0, 0.0, 0.0]), np.diag([1.0, 4.0, 1.0])
WITHIN[0, 1] = WITHIN[1, 0] = 3.0


def calibrations(
    rng: np.random.Generator, lots: int, units: int, tails: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Estimates (units, m, p), their covariances, and lots; the tails of the units are Student's where given."""
    lot = np.repeat(np.arange(lots), units)
    roots = [np.linalg.cholesky(c + 1e-12 * np.eye(P)) for c in (WITHIN, BETWEEN, ERROR)]
    shape = (lot.size, AXES, P)
    own = rng.standard_t(tails, shape) * np.sqrt((tails - 2.0) / tails) if tails else rng.standard_normal(shape)
    values = MEAN + own @ roots[0].T + rng.standard_normal(shape) @ roots[2].T
    values = values + (rng.standard_normal((lots, AXES, P)) @ roots[1].T)[lot]
    return values, np.broadcast_to(ERROR, (*shape, P)), lot


@pytest.fixture(scope="module")
def family() -> Family:
    return family_of(*calibrations(np.random.default_rng(8), 150, 6))


def test_spreads_of_units_and_of_lots_are_told_apart_without_the_errors_of_the_calibrations(family: Family) -> None:
    np.testing.assert_allclose(family.unit, np.stack([WITHIN] * AXES), rtol=0.25, atol=0.35)
    assert np.all(np.abs(family.mean - MEAN) < 4.0 * np.sqrt(np.diagonal(family.error, axis1=-2, axis2=-1)))
    between = np.diagonal(family.lot, axis1=-2, axis2=-1)
    assert between[:, 0] == pytest.approx(2.0, rel=0.5)
    assert np.all(between[:, 1:] < [0.3, 0.1])


def test_it_is_the_analysis_of_variance_where_all_errors_are_alike() -> None:
    """Balanced lots: within + error is the mean square inside lots; (mean square of lots − that)/n is the part between them."""
    values, error, lot = calibrations(np.random.default_rng(2), 60, 8)
    family = family_of(values, error, lot)
    groups = values.reshape(60, 8, AXES, P)
    inside = np.sum((groups - groups.mean(axis=1, keepdims=True)) ** 2, axis=(0, 1)) / (60 * 7)
    lots = 8 * np.var(groups.mean(axis=1), axis=0, ddof=1)
    found = np.diagonal(family.unit, axis1=-2, axis2=-1) + np.diag(ERROR)
    np.testing.assert_allclose(found[:, 0], inside[:, 0], rtol=0.01)
    np.testing.assert_allclose(np.diagonal(family.lot, axis1=-2, axis2=-1)[:, 0], (lots - inside)[:, 0] / 8, rtol=0.05)


@pytest.mark.slow
def test_the_unit_of_the_output_does_not_matter_and_a_small_family_predicts_with_a_wider_covariance() -> None:
    values, error, lot = calibrations(np.random.default_rng(4), 20, 4)
    one, other = family_of(values, error, lot), family_of(1e6 * values, 1e12 * error, lot)
    np.testing.assert_allclose(other.unit, 1e12 * one.unit, rtol=1e-6)
    np.testing.assert_allclose(other.precision, 1e-12 * one.precision, rtol=1e-6)
    values, error, lot = calibrations(np.random.default_rng(4), 9, 4)
    family = family_of(values, error, lot)
    assert family.within == pytest.approx(27.0 / 23.0 * family.unit)
    assert family.between == pytest.approx(8.0 / 4.0 * family.lot + family.error)


@pytest.mark.parametrize(
    ("tails", "least", "most"), mostly_slow([(0.0, 40.0, 1e6), (5.0, 5.0, 10.0)], (0.0, 40.0, 1e6))
)
def test_heavy_tails_are_seen(tails: float, least: float, most: float) -> None:
    rng = np.random.default_rng(6)
    family = family_of(*calibrations(rng, 100, 8, tails))
    assert np.all((family.tails[:, 0] >= least) & (family.tails[:, 0] <= most))


@pytest.mark.parametrize(("lots", "units"), [(6, 8), (20, 1), (0, 0)])
def test_too_few_lots_or_units_are_refused(lots: int, units: int) -> None:
    with pytest.raises(
        NotIdentified, match=f"prior: {lots * units} calibrations? in {lots} lots?, 3 coefficients need 7 lots"
    ):
        family_of(*calibrations(np.random.default_rng(1), lots, units))


def test_the_change_of_units_is_found_without_the_errors_of_their_calibrations() -> None:
    rng = np.random.default_rng(5)
    apart = rng.standard_normal((400, AXES, P)) * np.sqrt([1.0 + 4.0, 1.0, 9.0])
    change = change_of(apart, np.broadcast_to(np.diag([1.0, 1.0, 1.0]), (*apart.shape, P)))
    np.testing.assert_allclose(change, [[4.0, 0.0, 8.0]] * AXES, atol=1.8)
    assert np.all(change > 0.0)
    with pytest.raises(NotIdentified, match="3 pairs of calibrations of one unit, 12 are needed"):
        change_of(apart[:3], np.zeros((3, AXES, P, P)))


LOTS, UNITS = 60, 8
UNIT, LOT, WAFER, OF_FIT = (np.diag(d) for d in ([1.0, 4.0, 0.25], [0.5, 0.0, 0.1], [8.0, 4.0, 0.0], [0.2, 1.0, 0.1]))


def line(rng: np.random.Generator, *, crossed: bool = True, wafers: int = 40) -> tuple[np.ndarray, ...]:
    """Estimates, their covariances, lots, wafers and true values; a wafer's dice go into several lots, or a lot is a wafer."""
    lot = np.repeat(np.arange(LOTS), UNITS)
    wafer = rng.integers(0, wafers, lot.size) if crossed else lot
    drawn = (rng.standard_normal((count, AXES, P)) for count in (lot.size, LOTS, int(wafer.max()) + 1, lot.size))
    own, of_lot, of_wafer, noise = (z @ np.sqrt(c) for z, c in zip(drawn, (UNIT, LOT, WAFER, OF_FIT), strict=True))
    true = MEAN + own + of_wafer[wafer]
    measured = true + of_lot[lot]
    return measured + noise, np.broadcast_to(OF_FIT, (*true.shape, P)), lot, wafer, measured


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
