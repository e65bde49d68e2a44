"""Spikes, loud and stuck stretches and jumps are told in noise of any colour, and nothing is where there is only noise."""

from collections.abc import Callable

import numpy as np
import pytest
from long_suites import mostly_slow

from inertial.disturbances import disturbances


def coloured(rng: np.random.Generator, n: int, slope: float) -> np.ndarray:
    """Noise of density 1/f^slope, its steps of unit size."""
    f = np.fft.rfftfreq(n)
    spectrum = rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)
    spectrum[1:] *= f[1:] ** (-slope / 2.0)
    spectrum[0] = 0.0
    made = np.fft.irfft(spectrum, n)
    return made / np.std(np.diff(made))


NOISE: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "white": lambda rng, n: rng.standard_normal(n),
    "flicker": lambda rng, n: 0.3 * rng.standard_normal(n) + coloured(rng, n, 1.0),
    "walk": lambda rng, n: rng.standard_normal(n) + 0.02 * np.cumsum(rng.standard_normal(n)),
    "walk alone": lambda rng, n: np.cumsum(rng.standard_normal(n)),
    "1/f^2.5": lambda rng, n: 0.2 * rng.standard_normal(n) + coloured(rng, n, 2.5),
    "ramp": lambda rng, n: rng.standard_normal(n) + np.linspace(0.0, 30.0, n),
    "bent drift": lambda rng, n: rng.standard_normal(n) + 30.0 * (np.arange(n) / n - rng.uniform()) ** 2,
    "slow wave": lambda rng, n: rng.standard_normal(n) + 5.0 * np.sin(np.arange(n) / n * 2.0 * np.pi * 7.0),
    "vibration": lambda rng, n: rng.standard_normal(n) + 3.0 * np.sin(0.7 * np.arange(n)),
    "coarse digits": lambda rng, n: np.round(0.6 * rng.standard_normal(n)),
    "few digits": lambda rng, n: np.round(0.25 * rng.standard_normal(n)),
    "rounding": lambda rng, n: np.diff(rng.uniform(-0.5, 0.5, n + 1)),
    "louder slowly": lambda rng, n: rng.standard_normal(n) * np.linspace(1.0, 1.3, n),
}


@pytest.mark.parametrize("kind", mostly_slow(NOISE, *list(NOISE)[::3]))
def test_nothing_is_told_of_noise_drift_and_waves(kind: str) -> None:
    told = []
    for k in range(20):
        rng = np.random.default_rng([604, k])
        told += disturbances(NOISE[kind](rng, int(2.0 ** rng.uniform(9.0, 15.0))))
    assert told == []


@pytest.mark.parametrize("kind", ["white", "flicker", "walk"])
@pytest.mark.parametrize("seed", range(4))
def test_each_disturbance_is_told_as_what_it_is_and_where(kind: str, seed: int) -> None:
    rng = np.random.default_rng([817, seed])
    n = 20_000
    record = NOISE[kind](rng, n)
    at = int(rng.uniform(0.2, 0.8) * n)
    spikes, loud, stuck, jump = (record.copy() for _ in range(4))
    spikes[rng.choice(n, 5, replace=False)] += 300.0
    loud[at : at + 900] += 6.0 * rng.standard_normal(900)
    stuck[at : at + 400] = stuck[at]
    jump[at:] += 25.0
    (one,) = disturbances(spikes)
    assert (one.kind, one.count) == ("spikes", 5)
    assert one.size == pytest.approx(300.0, rel=0.05)
    (one,) = disturbances(loud)
    assert one.kind == "loud"
    assert abs(one.start - at) < 40
    assert abs(one.stop - at - 900) < 40
    (one,) = disturbances(stuck)
    assert (one.kind, one.start, one.stop) == ("stuck", at, at + 400)
    (one,) = disturbances(jump)
    assert one.kind == "jump"
    assert one.size == pytest.approx(25.0, rel=0.3)
    assert abs(one.start - at) < 64


@pytest.mark.parametrize("kind", ["white", "flicker", "walk"])
@pytest.mark.parametrize("count", [1, 10])
def test_steps_on_the_floor_are_bursts_and_one_of_them_is_none(kind: str, count: int) -> None:
    rng = np.random.default_rng([818, count])
    record = NOISE[kind](rng, 180_000)
    at = np.linspace(20_000, 160_000, count).astype(int)
    for k in at:
        record[k : k + 10] += 8.0 * np.cos(0.9 * np.pi * np.arange(10))
    found = disturbances(record)
    assert [(one.kind, one.count, one.material) for one in found] == [("bursts", 10, False)] * (count > 1)
    assert all(abs(one.start - at[0]) < 40 and abs(one.stop - at[-1] - 10) < 40 for one in found)


def test_heavy_tails_are_no_bursts() -> None:
    told = [one.kind for k in range(8) for one in disturbances(np.random.default_rng([819, k]).standard_t(5, 100_000))]
    assert "bursts" not in told


@pytest.mark.parametrize("kind", ["white", "flicker", "walk"])
@pytest.mark.parametrize("share", [0.003, 0.01, 0.03])
def test_a_warm_up_is_told_with_its_size_and_end(kind: str, share: float) -> None:
    """First-order settling with a time constant of so much of the record, 25 times what the noise wanders meanwhile."""
    for seed in range(5):
        rng = np.random.default_rng([4411, seed])
        n = 20_000
        noise = NOISE[kind](rng, n)
        later = noise[n // 2 :]
        length = max(int(share * n), 64)
        moved = np.std(np.diff(later[: later.size // length * length].reshape(-1, length).mean(axis=1)))
        height = rng.choice([-1.0, 1.0]) * max(25.0 * moved, 30.0)
        (one,) = disturbances(noise + height * np.exp(-np.arange(n) / (share * n)))
        assert (one.kind, one.start) == ("settling", 0)
        assert 1.0 < one.stop / (share * n) < 16.0
        assert 0.7 < -one.size / height < 1.1
