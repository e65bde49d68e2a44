"""Overlapping Allan deviation: values against a peer, degrees of freedom, coverage of the intervals, refusals."""

import allantools
import made_noise as generate
import numpy as np
import pytest

from inertial.noise.allan import decades, octaves, overlapping
from inertial.noise.covariance import sums
from inertial.noise.mixture import basis


@pytest.mark.parametrize("rate_hz", [1.0, 100.0])
@pytest.mark.parametrize("offset", [0.0, 3.0e6])
def test_equals_allantools_to_a_billionth(rate_hz: float, offset: float) -> None:
    rng = np.random.default_rng(11)
    x = rng.normal(size=(3, 5000)) + np.cumsum(rng.normal(size=(3, 5000)), axis=-1) * 0.01 + offset
    curve = overlapping(x, rate_hz, np.array([1, 2, 3, 7, 50, 400, 1500]))
    for channel in range(3):
        centred = x[channel] - x[channel].mean()
        _, peer, _, _ = allantools.oadev(centred, rate=rate_hz, data_type="freq", taus=curve.tau)
        np.testing.assert_allclose(curve.deviation[channel], peer, rtol=1e-9)
    alone = overlapping(x[2], rate_hz, curve.m)
    np.testing.assert_allclose(curve.deviation[2], alone.deviation, rtol=1e-12)
    np.testing.assert_allclose(curve.edf[2], alone.edf, rtol=1e-9)


@pytest.mark.parametrize(("term", "alpha", "tolerance"), [(0, 2, 1e-6), (1, 0, 0.03), (2, -1, 0.08), (3, -2, 0.01)])
def test_degrees_of_freedom_agree_with_greenhall(term: int, alpha: int, tolerance: float) -> None:
    n, spacings = 20_000, (64, 256, 1024, 4096)
    moments, v = sums(n, spacings), basis(np.array(spacings))[:, term]
    if term == 1:  # differences of white noise correlate by -1/2 with their neighbours only: edf = M / (1 + 2/4)
        assert 2.0 / sums(4000, (1,)).quadratic[0, 0, 1, 1] == pytest.approx(3999 / 1.5, rel=1e-3)
    for i, m in enumerate(spacings):
        mine = 2.0 * v[i] ** 2 / moments.quadratic[i, i, term, term]
        peer = allantools.edf_greenhall(alpha, 2, m, n + 1, overlapping=True, modified=False)
        assert mine == pytest.approx(peer, rel=tolerance)


@pytest.mark.parametrize("kind", ["white", "flicker", "walk"])
def test_intervals_cover_the_truth_as_often_as_they_say(kind: str) -> None:
    rng, records, n = np.random.default_rng(5), 400, 2048
    term, made = {
        "white": (1, lambda: generate.white(rng, (records, n), np.sqrt(2.0), 1.0)),
        "flicker": (2, lambda: generate.flicker(rng, (records, 3 * n), 1.0)[:, 2 * n :]),
        "walk": (3, lambda: generate.random_walk(rng, (records, n), 1.0, 1.0)),
    }[kind]
    curve = overlapping(made(), 1.0, np.array([8, 32, 128, 512]))
    truth = np.sqrt(basis(curve.m)[:, term])
    covered = np.mean((curve.low <= truth) & (truth <= curve.high), axis=0)
    assert np.all(np.abs(covered - 0.6827) < 0.1), covered


def test_default_averaging_times_go_to_a_third_of_the_record() -> None:
    assert octaves(100).tolist() == [1, 2, 4, 8, 16, 32]
    assert decades(100).tolist() == [1, 2, 5, 10, 20]
    assert overlapping(np.arange(100.0) % 7, 10.0, "decade").tau.tolist() == [0.1, 0.2, 0.5, 1.0, 2.0]


def test_refuses_records_that_say_nothing() -> None:
    for words, x, *more in (
        ("record of 3 samples", np.zeros(3), 1.0),
        ("sample 20 is nan", np.array([0.0] * 20 + [np.nan] + [1.0] * 20), 1.0),
        ("sampling rate", np.zeros(30), 0.0),
        ("1 to 14 are possible", np.zeros(30), 1.0, [1, 20]),
    ):
        with pytest.raises(ValueError, match=words):
            overlapping(x, *more)
