"""Noise that units share is not averaged out over them, and a difference between effects is worth less for it."""

import numpy as np
import pytest

from inertial import effects as catalogue
from inertial.estimation.likelihood import shared_factor
from inertial.estimation.model import Model
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.term import Term
from inertial.frames import force_from_angles
from inertial.state import State

UNITS, DWELLS = 4, 120
PLAIN = [Term(catalogue.get(name)) for name in ("bias", "scale", "misalignment")]
DRIFT = Term(catalogue.get("aging_linear"))


def model_of(rng: np.random.Generator, together: float, drift: np.ndarray, *, missing: bool = False) -> Model:
    """Ideal units that drift, with noise of a microgram of which the share ``together`` is the same in all units."""
    outer, inner = rng.uniform(-3.0, 3.0, (2, DWELLS))
    time = np.broadcast_to(30.0 * np.arange(DWELLS), (UNITS, DWELLS))
    force = np.broadcast_to(force_from_angles(outer, inner), (UNITS, DWELLS, 3))
    own, common = rng.standard_normal((UNITS, DWELLS, 3)), rng.standard_normal((DWELLS, 3))
    noise = 1e-6 * (np.sqrt(1.0 - together) * own + np.sqrt(together) * common)
    output = force + drift[:, None, None] * (time / 3600.0)[..., None] + noise
    error = np.full(output.shape, 1e-6)
    if missing:
        error[0, 5] = np.inf
    lot = Lot(State(force=force, time=time), output, error, np.broadcast_to(np.eye(3), (UNITS, 3, 3)))
    return Model(Problem(lot), [*PLAIN, DRIFT])


@pytest.mark.parametrize("missing", [False, True])
def test_what_is_alike_in_all_units_counts_less_the_more_they_share(rng, missing):
    for together in (0.3, 0.5, 0.9):
        factor = shared_factor(model_of(rng, together, np.full(UNITS, 2e-5), missing=missing), DRIFT)
        assert factor == pytest.approx(1.0 + (UNITS - 1) * together, rel=0.12)


def test_independent_units_one_unit_and_what_differs_in_sign_from_unit_to_unit_count_in_full(rng):
    assert shared_factor(model_of(rng, 0.0, np.full(UNITS, 2e-5)), DRIFT) == 1.0
    lot = model_of(rng, 0.5, np.full(UNITS, 2e-5)).problem.lot
    assert shared_factor(Model(Problem(lot.units([0])), [*PLAIN, DRIFT]), DRIFT) == 1.0
    signs = np.array([1.0, -1.0, 1.0, -1.0])
    assert shared_factor(model_of(rng, 0.6, 2e-5 * signs), DRIFT) == pytest.approx(1.0, abs=0.05)


def test_the_factor_is_by_how_much_a_sum_over_units_scatters_more(rng):
    """The slope of the drift, averaged over the units: its variance over runs against that of independent units."""
    slope = np.linspace(-1.0, 1.0, DWELLS)
    slope /= np.linalg.norm(slope)

    def variance(together: float) -> float:
        own, common = rng.standard_normal((3000, UNITS, DWELLS)), rng.standard_normal((3000, 1, DWELLS))
        return float(np.var(((np.sqrt(1.0 - together) * own + np.sqrt(together) * common) @ slope).mean(axis=1)))

    factor = shared_factor(model_of(rng, 0.5, np.full(UNITS, 2e-5)), DRIFT)
    assert factor == pytest.approx(variance(0.5) / variance(0.0), rel=0.15)
