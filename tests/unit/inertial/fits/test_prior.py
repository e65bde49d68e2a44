"""A prior in the fit: as one more observation; judged by the lot; in the predicted residuals."""

from dataclasses import replace

import numpy as np
import pytest
from posed import posed

from inertial import poses
from inertial.design import local_columns, split
from inertial.fits.prior import combined, judged
from inertial.fits.wander import fit_lot_with_wander, wander_kernels
from inertial.population.family import Family
from inertial.state import State

EFFECTS = ("bias", "scale", "misalignment")
P, UNITS, WHITE = 4, 8, 1e-5


def family(spread: float = 1.0, lot: float = 0.2, tails: float = 1e6, mean: float = 0.0) -> Family:
    """Of coefficients that spread alike, of very many units and lots."""
    unit = np.broadcast_to(spread**2 * np.eye(P), (3, P, P))
    flat = np.full((3, P), tails)
    return Family(flat * 0.0 + mean, unit, (lot / spread) ** 2 * unit, 1e-9 * unit, 10**6, 10**5, flat)


def estimates(
    rng: np.random.Generator, units: int = UNITS, lot: float = 0.2, off: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of a lot of that family with errors of 0.5, ``off`` from its mean in the bias, and their covariances."""
    own, of_lot, error = (rng.standard_normal(shape) for shape in ((units, 3, P), (3, P), (units, 3, P)))
    values = own + lot * of_lot + 0.5 * error
    values[..., 0] += off
    return values, np.broadcast_to(0.25 * np.eye(P), (units, 3, P, P))


NAMES = ("bias", "scale", "misalignment", "misalignment")


def test_it_is_the_fit_of_the_observations_and_the_prior_together(rng: np.random.Generator) -> None:
    columns, z = rng.standard_normal((9, P)), rng.standard_normal(9)
    known = rng.standard_normal((P, P))
    mean, prior = rng.standard_normal(P), known @ known.T + np.eye(P)
    covariance = np.asarray(np.linalg.inv(columns.T @ columns), dtype=np.float64)
    alone = covariance @ columns.T @ z
    root = np.linalg.cholesky(np.linalg.inv(prior)).T
    both, *_ = np.linalg.lstsq(np.vstack([columns, root]), np.concatenate([z, root @ mean]), rcond=None)
    precision = np.asarray(np.linalg.inv(prior), dtype=np.float64)
    found = combined(alone, covariance, mean, precision)
    np.testing.assert_allclose(found.coefficients, both, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(columns.T @ columns + root.T @ root), rtol=1e-9)
    of_prior = found.covariance @ root.T @ root @ found.covariance
    np.testing.assert_allclose(found.share, np.diagonal(of_prior) / np.diagonal(found.covariance), rtol=1e-9)


def test_lots_of_the_family_have_its_prior(rng: np.random.Generator) -> None:
    priors = [judged(family(), NAMES, *estimates(rng)) for _ in range(300)]
    assert np.mean([~prior.fits for prior in priors]) < 0.01
    assert np.mean([bool(prior.widened) for prior in priors]) < 0.05


@pytest.mark.parametrize("units", [1, 4, 8])
def test_a_unit_off_its_family_has_no_prior_and_the_others_have(rng: np.random.Generator, units: int) -> None:
    values, covariance = estimates(rng, units)
    values[0, 1, 1] = 12.0
    prior = judged(family(), NAMES, values, covariance)
    assert prior.fits.tolist() == [False, *[True] * (units - 1)]
    assert prior.p_unit[0] < 1e-6
    assert not prior.precision[0].any()


def test_a_lot_off_its_family_widens_the_prior_of_the_effect(rng: np.random.Generator) -> None:
    prior = judged(family(), NAMES, *estimates(rng, off=8.0))
    assert prior.fits.all()
    assert list(prior.widened) == ["bias"]
    wide = np.sqrt(np.diagonal(prior.covariance, axis1=-2, axis2=-1))
    assert np.all(wide[..., 0] > 5.0)
    assert wide[..., 1:] == pytest.approx(np.sqrt(1.04), rel=0.01)


def test_units_that_spread_more_than_the_family_widen_it(rng: np.random.Generator) -> None:
    values, covariance = estimates(rng)
    prior = judged(family(spread=0.1, lot=0.2), NAMES, values, covariance)
    assert set(prior.widened) == set(NAMES)
    assert all(within > 20.0 for within, _ in prior.widened.values())


def test_heavy_tails_keep_units_that_normal_ones_would_lose(rng: np.random.Generator) -> None:
    values, covariance = estimates(rng)
    values[0, 0, 1] = 6.5
    assert not judged(family(), NAMES, values, covariance).fits[0]
    assert judged(family(tails=5.0), NAMES, values, covariance).fits[0]


def test_the_fit_of_a_lot_is_generalised_least_squares_with_the_prior_as_rows(rng: np.random.Generator) -> None:
    state: State = posed(np.tile(poses.plan("fibonacci24"), (2, 1)), 30.0)
    n, used = 48, np.arange(48) < 40
    time = np.broadcast_to(state.time, n)
    slow = np.linalg.cholesky(wander_kernels(time)[0] + 1e-9 * np.eye(n))
    out = state.force + 3e-5 * np.einsum("nm,uma->una", slow, rng.standard_normal((UNITS, n, 3)))
    out = out + WHITE * rng.standard_normal(out.shape)
    mean = np.tile([1e-5, 1.0, 0.0, 0.0], (3, 1))
    precision = np.diag([1.0, 4.0, 1.0, 0.25]) / (1e-5) ** 2
    error = np.full(out.shape, WHITE)
    alone = fit_lot_with_wander(EFFECTS, state, out, error, used=used)
    with_prior = {"used": used, "believed": lambda t, c: combined(t, c, mean, precision)}
    found = fit_lot_with_wander(EFFECTS, state, out, error, **with_prior)
    kernels = wander_kernels(time, used)
    shares = (alone.flicker_share, alone.walk_share)
    whole = np.eye(n) + sum(s * k for s, k in zip(shares, kernels, strict=True))
    level = WHITE * alone.white * alone.widened
    for axis in range(3):
        rows = local_columns(split(EFFECTS)[0], state, {})[axis]
        inside = np.linalg.inv(level**2 * whole[np.ix_(used, used)])
        both = np.linalg.inv(rows[used].T @ inside @ rows[used] + precision)
        gain = both @ rows[used].T @ inside
        theta = out[:, used, axis] @ gain.T + both @ precision @ mean[axis]
        np.testing.assert_allclose(found.fit.coefficients[:, axis], theta, rtol=1e-7, atol=1e-11)
        np.testing.assert_allclose(found.fit.covariance[:, axis], [both] * UNITS, rtol=1e-6, atol=1e-16)
        np.testing.assert_allclose(found.fit.residuals[..., axis], out[..., axis] - theta @ rows.T, atol=1e-10)
        take = np.eye(n)[~used]
        take[:, used] -= rows[~used] @ gain
        back = rows[~used] @ both @ precision @ both @ rows[~used].T
        direct = level**2 * take @ whole @ take.T + back
        np.testing.assert_allclose(found.predicted[0, axis], direct, rtol=1e-5, atol=1e-16)
    assert found.of_prior is not None
    assert np.all((found.of_prior > 0.0) & (found.of_prior < 1.0))


def test_own_earlier_calibrations_take_the_place_of_the_family(rng: np.random.Generator) -> None:
    values, covariance = estimates(rng, 4)
    values[:2] += 30.0
    values[2] -= 30.0
    here = values + 0.1
    here[2, :, 1] += 9.0
    own = {f"U{k}": (here[k], 0.04 * np.broadcast_to(np.eye(P), (3, P, P))) for k in range(3)}
    prior = judged(replace(family(), own=own), NAMES, values, covariance, ["U0", "U1", "U2", "U3"])
    assert prior.fits.tolist() == [True, True, False, True]
    np.testing.assert_array_equal(prior.mean[0], here[0])
    np.testing.assert_array_equal(prior.mean[3], 0.0)
    assert np.diagonal(prior.covariance[1], axis1=-2, axis2=-1) == pytest.approx(0.04, rel=0.01)
