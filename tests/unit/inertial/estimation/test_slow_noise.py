"""Noise of the means of dwells, by the samples inside them."""

import numpy as np

from inertial.estimation.slow_noise import FEWEST_SAMPLES, slow_deviation

RATE = 50.0


def _errors(rng: np.random.Generator, noise: str, seconds: float) -> tuple[float, float, float]:
    """Standard deviation of the means of 300 dwells, by :func:`slow_deviation`, and by the scatter of the samples."""
    n = round(RATE * seconds)
    time = np.arange(n) / RATE
    phase = rng.uniform(0.0, 2.0 * np.pi, (300, 1))
    white = rng.standard_normal((300, n))
    samples = {
        "white": white,
        "engine": 0.3 * white + 10.0 * np.sin(2.0 * np.pi * 13.07 * time + phase),
        "breath": 0.3 * white + np.sin(2.0 * np.pi * 0.25 * time + phase),
    }[noise]
    told = slow_deviation([own[:, None] for own in samples])[:, 0] / np.sqrt(n)
    plain = np.sqrt(np.mean(samples.var(axis=1, ddof=1)) / n)
    return float(samples.mean(axis=1).std()), float(np.sqrt(np.mean(told**2))), float(plain)


def test_white_noise_is_told_as_it_is_a_vibration_averages_out_and_a_breath_does_not(rng: np.random.Generator) -> None:
    true, told, plain = _errors(rng, "white", 6.0)
    np.testing.assert_allclose([told, plain], true, rtol=0.12)
    true, told, plain = _errors(rng, "engine", 5.03)
    assert plain > 5.0 * true
    np.testing.assert_allclose(told, true, rtol=0.25)
    true, told, plain = _errors(rng, "breath", 7.0)
    assert plain < 0.6 * true
    assert true < told < 3.0 * true
    true, told, _ = _errors(rng, "breath", 30.6)
    np.testing.assert_allclose(told, true, rtol=0.3)


def test_dwells_that_are_alike_have_one_deviation_and_a_loud_one_keeps_its_own(rng: np.random.Generator) -> None:
    alike = [rng.standard_normal((200, 1)) for _ in range(30)]
    own = slow_deviation(alike)[:, 0]
    assert own.std() < 0.1 * own.mean()
    loud = slow_deviation([*alike, 30.0 * rng.standard_normal((200, 1))])[:, 0]
    assert loud[-1] > 10.0 * np.median(loud[:-1])


def test_an_output_without_noise_has_none(rng: np.random.Generator) -> None:
    still = np.column_stack([np.ones(FEWEST_SAMPLES), rng.standard_normal(FEWEST_SAMPLES)])
    told = slow_deviation([still] * 3)
    assert not told[:, 0].any()
    assert np.all(told[:, 1] > 0.0)
