"""Errors that the units of a lot have in common are not their noise: coefficients carry the wander that the units show apart."""

import numpy as np
import pytest

from benchmarks.budget import one_lot
from benchmarks.budget_lots import plan_of
from inertial.fits.wander import fit_lot_with_wander
from inertial.frames import force_from_angles
from inertial.noise.dwells import DwellNoise, dwell_covariance
from inertial.state import State
from stations.plant.preset import load_preset

EFFECTS = ("bias", "scale", "misalignment")


def test_a_pattern_of_the_table_hides_no_flicker_of_quiet_units() -> None:
    """Flicker of 30 µg under an error of the poses of 100 µg that every soak repeats: the bias scatters as is stated."""
    rng = np.random.default_rng(5)
    angles = np.radians(rng.uniform(-180.0, 180.0, (24, 2)))
    force = np.tile(force_from_angles(angles[:, 0], angles[:, 1]), (3, 1))
    time = 17.0 * np.arange(len(force))
    root = np.linalg.cholesky(dwell_covariance(time, 10.0, DwellNoise(0.1e-6, 30e-6), since=-5.0))
    pulls, alone = [], []
    for _ in range(40):
        table = np.tile(100e-6 * rng.standard_normal((24, 3)), (3, 1))
        wander = np.einsum("nm,uma->una", root, rng.standard_normal((6, len(force), 3)))
        for common, into in ((table, pulls), (0.0, alone)):
            found = fit_lot_with_wander(
                EFFECTS, State(force=force, time=time), force + wander + common, np.full((6, len(force), 3), 1e-6)
            )
            bias = [names.index(("bias", "K0")) for names in found.fit.names]
            for axis, place in enumerate(bias):
                error = found.fit.coefficients[:, axis, place] - found.fit.coefficients[:, axis, place].mean()
                into.extend((error / np.sqrt(found.fit.covariance[:, axis, place, place] * 5.0 / 6.0)).tolist())
    assert np.mean(np.abs(alone) < 1.96) == pytest.approx(0.95, abs=0.04)
    assert np.mean(np.abs(pulls) < 1.96) > 0.9


def test_certified_bias_terms_of_quiet_devices_on_a_workshop_table_are_covered() -> None:
    plan, preset, rng = plan_of("24 directions × 3"), load_preset("qa700"), np.random.default_rng(4)
    lots = [one_lot(plan, preset, rng) for _ in range(12)]
    inside = np.concatenate([lot["coefficients"] for lot in lots]).reshape(-1, 3, 6)
    assert np.mean(inside[..., [0, 4]]) > 0.93
