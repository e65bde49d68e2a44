"""Intervals of Ppk and of gauge studies where the truth is drawn."""

import numpy as np
import pytest

from inertial.population.capability import cpk, shape_of
from inertial.population.gauge import gauge_study


@pytest.mark.parametrize("n", [20, 50, 200])
def test_the_interval_of_ppk_holds_for_folded_values(n: int, rng: np.random.Generator) -> None:
    mean, sigma = np.sqrt(2.0 / np.pi), np.sqrt(1.0 - 2.0 / np.pi)
    limit, held, normal, runs = mean + 4.0 * sigma, 0, 0, 1500
    for values in np.abs(rng.normal(size=(runs, n))):
        own = float(values.mean()), float(values.std(ddof=1)), -np.inf, limit, n
        index, plain = cpk(*own, shape=shape_of(values)), cpk(*own)
        held += index.low <= 4.0 / 3.0 <= index.high
        normal += plain.low <= 4.0 / 3.0 <= plain.high
    assert held / runs > 0.92
    assert normal / runs < 0.9


@pytest.mark.parametrize(
    ("shape", "part", "station", "interaction"), [((10, 3, 3), 3.0, 1.0, 0.5), ((8, 1, 3), 3.0, 0.0, 0.0)]
)
def test_the_intervals_of_a_gauge_study_hold(shape, part, station, interaction, rng):
    p, o, _ = shape
    gauge = float(np.sqrt(1.0 + station**2 + interaction**2))
    percent, held, runs = 100.0 * gauge / np.hypot(gauge, part), np.zeros(2), 300
    for _ in range(runs):
        values = part * rng.normal(size=(p, 1, 1)) + station * rng.normal(size=(1, o, 1)) + rng.normal(size=shape)
        study = gauge_study(values + interaction * rng.normal(size=(p, o, 1)))
        ends = study.gauge_interval, study.percent_interval
        held += [low <= true <= high for (low, high), true in zip(ends, (gauge, percent), strict=True)]
    assert np.all(held / runs > 0.91)
