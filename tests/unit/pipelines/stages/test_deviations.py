"""Other statistics than the Allan deviation: units, coverage of their intervals, where there is none, MTIE against a peer."""

from dataclasses import replace
from itertools import product

import allantools
import made_noise as generate
import numpy as np
import pytest
from long_suites import mostly_slow

from inertial.noise.allan import overlapping
from inertial.noise.mixture import basis
from inertial.noise.terms import fit_terms
from pipelines.cli import noise
from pipelines.stages.deviations import STATISTICS, Deviations, deviations

RECORDS, N = 150, 2048
KINDS = {
    "white": lambda rng: generate.white(rng, (RECORDS, N), np.sqrt(2.0), 1.0),
    "flicker": lambda rng: generate.flicker(rng, (RECORDS, 3 * N), 1.0)[:, 2 * N :],
    "walk": lambda rng: generate.random_walk(rng, (RECORDS, N), 1.0, 1.0),
}


def of_noise(name: str, kind: str) -> Deviations:
    """A statistic of records of one kind of noise, which is known: the fit of the terms is another matter."""
    records = KINDS[kind](np.random.default_rng(5))
    curve = overlapping(records, 1.0)
    alone = np.eye(5)[{"white": 1, "flicker": 2, "walk": 3}[kind]]
    terms = replace(fit_terms(overlapping(records[:1], 1.0)), mixture=np.tile(alone, (RECORDS, 1)))
    return deviations(STATISTICS[name], records, "g", curve, terms, explained=np.ones(RECORDS, dtype=bool))


def evaluated(name: str, records: np.ndarray, unit: str = "g", rate_hz: float = 1.0) -> Deviations:
    curve = overlapping(records, rate_hz)
    terms = fit_terms(curve)
    return deviations(STATISTICS[name], records, unit, curve, terms, explained=terms.p_value >= 1e-6)


EVERY = [*product(("modified", "hadamard", "total"), KINDS)]


@pytest.mark.parametrize(("name", "kind"), mostly_slow(EVERY, *EVERY[::4]))
def test_intervals_cover_the_truth_as_often_as_they_say(name: str, kind: str) -> None:
    found = of_noise(name, kind)
    m = np.round(found.tau).astype(np.int64)
    allan_variance = basis(m)[:, {"white": 1, "flicker": 2, "walk": 3}[kind]]
    # variance over the Allan variance at many samples, from the densities h·f^α of SP 1065, 5.5 and 5.2
    ratio = {
        "modified": {"white": 0.5, "flicker": 0.675, "walk": 0.824},
        "hadamard": {"white": 1.0, "flicker": np.log(256 / 27) / (4.0 * np.log(2.0)), "walk": 0.5},
        "total": {"white": 1.0, "flicker": 1.0, "walk": 1.0},
    }[name][kind]
    truth = np.sqrt(allan_variance * ratio)
    covered = np.mean((found.low <= truth) & (truth <= found.high), axis=0)
    # the first averaging times have other ratios
    assert np.all(np.abs(covered[4:] - 0.6827) < 0.12), covered
    if (name, kind) == ("total", "white"):  # it claims no more at one sample than the Allan deviation
        assert np.mean((found.low[:, 0] <= 1.0) & (found.high[:, 0] >= 1.0)) > 0.6


def test_the_maximum_time_interval_error_is_that_of_allantools() -> None:
    record = np.random.default_rng(3).normal(size=3000) + 5.0
    m = np.array([1.0, 2.0, 3.0, 64.0, 501.0, 1000.0])
    mine = STATISTICS["mtie"].compute(record, 50.0, m)
    peer = allantools.mtie(record, rate=50.0, data_type="freq", taus=m / 50.0)[1]
    np.testing.assert_allclose(mine, peer, rtol=1e-12)
    assert ("allan", *STATISTICS) == noise.STATISTICS  # the command offers every statistic


def test_integrals_of_an_acceleration_are_velocities() -> None:
    # a square wave of ±1 mg with a half period of 8 s: the velocity runs up and down by 8 s · 1 mg
    record = np.tile(np.repeat([1.0, -1.0], 80), 32)[None] + 1e-3 * np.random.default_rng(1).normal(size=(1, 5120))
    found = evaluated("mtie", record, "mg", 10.0)
    assert found.unit == "m/s"
    assert found.deviation[0, -1] == pytest.approx(8.0 * 9.80665e-3, rel=0.02)
    assert evaluated("time", record, "LSB", 10.0).unit == "LSB·s"
    assert evaluated("tie", record, "", 10.0).unit == "unit·s"
    assert evaluated("modified", record, "mg", 10.0).unit == "mg"


def test_there_is_no_interval_where_no_degrees_of_freedom_are_known() -> None:
    rng = np.random.default_rng(4)
    white = rng.normal(size=(1, 4000))
    for name in ("tie", "mtie"):
        assert np.all(np.isnan(evaluated(name, white).low))
    ramp = white + 0.02 * np.arange(4000)
    modified, hadamard = evaluated("modified", ramp), evaluated("hadamard", ramp)
    assert np.isfinite(modified.low[0, 0])
    assert np.isnan(modified.low[0, -1])  # a ramp is no noise
    assert np.all(np.isfinite(hadamard.low))  # and is not seen here
    np.testing.assert_allclose(hadamard.deviation, evaluated("hadamard", white).deviation, rtol=1e-6)
    vibration = white + 3.0 * np.sin(np.arange(4000) / 3.0)
    assert np.all(np.isnan(evaluated("modified", vibration).low))  # no mixture explains it
