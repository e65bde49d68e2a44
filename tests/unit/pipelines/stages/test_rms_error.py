"""Stated uncertainties over the standard deviation between runs, for noise of an independent generator.

Larger numbers: `python benchmarks/noise_verdicts.py verification` and `bias`.
"""

from itertools import product

import independent_lots as lots
import numpy as np
import pytest

from inertial.noise.measurands import against_mean, flicker_mean, walk_mean
from pipelines.stages.fit import fit
from pipelines.stages.rms_error import rms_uncertainty
from pipelines.stages.verify import verify

CHECKS = ((35.0, 15.0), (125.0, -160.0), (70.0, 100.0), (160.0, 20.0), (100.0, -60.0), (20.0, -120.0))
MODEL = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]
NOISES = {
    "white": {"density": 150.0, "flicker": 0.0},
    "flicker": {"flicker": 30.0},
    "flicker and walk": {"flicker": 30.0, "walk": 4.0},
    "white and walk": {"density": 100.0, "flicker": 0.0, "walk": 2.0},
}
# series of 20 runs: 240, by which the standard deviation of theirs is known within 5 %; of 6 runs within 9 %
CASES = [("flicker", 6, 0.25), ("white and walk", 6, 0.25)]
CASES += [pytest.param(name, 20, 0.15, marks=pytest.mark.slow) for name in NOISES]


@pytest.mark.parametrize(("name", "runs", "within"), CASES)
def test_stated_uncertainties_are_the_standard_deviations_between_runs(name: str, runs: int, within: float) -> None:
    rng = np.random.default_rng([20_261_201, len(name)])
    rms, u_rms, wrong, u_record = [], [], [], []
    for _ in range(runs):
        world = lots.world(
            rng, plan="fibonacci", temperatures=(-10.0, 25.0, 60.0), checks=CHECKS, move_s=20, day_s=0, **NOISES[name]
        )
        fitted = fit(world.dwells, lots.NO_HISTORY, MODEL)
        tables = (fitted[name] for name in ("coefficients", "covariance", "predictions"))
        for _, own in verify(world.dwells, lots.NO_HISTORY, *tables)["verification"].groupby("unit"):
            rms += [float(np.sqrt(np.mean(own[f"error_{axis}_ug"] ** 2))) for axis in "xyz"]
            u_rms += [float(own[f"rms_uncertainty_{axis}_ug"].iloc[0]) for axis in "xyz"]
        bias = fitted["coefficients"].query("effect == 'bias'").sort_values(["unit", "axis"])["value"].to_numpy()
        wrong.append(1e6 * bias.reshape(-1, 3) - world.record)
        u_record.append(fitted["wander"].sort_values(["unit", "axis"])["bias_record_u_ug"].to_numpy())
    assert np.mean(u_rms) / np.std(rms) == pytest.approx(1.0, abs=within)
    assert np.median(u_record) / np.sqrt(np.mean(np.square(wrong))) == pytest.approx(1.0, abs=within + 0.05)


@pytest.mark.slow
def test_the_standard_deviation_of_a_root_of_squares_agrees_with_drawn_numbers_and_is_none_of_no_noise() -> None:
    for sizes, error in product(
        ([1.0], [1.0] * 4, [1.0] * 30, [10.0, *[0.3] * 20], [5.0, 3.0, 1.0, 0.2, 0.1]), (0.0, 30.0)
    ):
        drawn = np.random.default_rng(20_261_202).standard_normal((20_000, len(sizes))) * np.sqrt(sizes)
        drawn[:, 0] += error
        u = rms_uncertainty(drawn, np.broadcast_to(np.diag(sizes), (20_000, len(sizes), len(sizes))))
        spread = np.std(np.sqrt(np.mean(drawn**2, axis=1)))
        assert np.mean(u) / spread == pytest.approx(1.0, abs=0.08), (sizes, error)
    for errors in (np.array([3.0, 4.0]), np.zeros(2)):
        assert rms_uncertainty(errors, np.zeros((2, 2))) == 0.0


def test_a_mean_of_the_record_is_what_the_mean_of_its_dwells_shows() -> None:
    """Sums of 4000 walks and of Ornstein–Uhlenbeck processes; the coefficient is the plain mean of the dwells."""
    rng, n = np.random.default_rng(20_261_203), 400
    walk = np.cumsum(rng.standard_normal((4000, n)), axis=1)
    slow = np.empty((4000, n))
    slow[:, 0] = rng.standard_normal(4000)
    for k in range(1, n):
        slow[:, k] = slow[:, k - 1] * np.exp(-1 / 100) + rng.standard_normal(4000) * np.sqrt(-np.expm1(-2 / 100))
    places = np.arange(20, 200, 40)
    gain = np.full(places.size, 1.0 / places.size)
    time = places.astype(float)
    for path, kind, covariance in (
        (walk, walk_mean(time, -1.0, 0.0, 199.0), np.minimum.outer(time, time) + 1.0),
        (slow, flicker_mean(time, np.array([100.0]), 0.0, 199.0), np.exp(-np.abs(np.subtract.outer(time, time)) / 100)),
    ):
        stated = gain @ covariance @ gain + against_mean(np.ones(()), gain, kind)
        shown = np.var(path[:, places] @ gain - path[:, :200].mean(axis=1))
        assert stated == pytest.approx(shown, rel=0.1)
