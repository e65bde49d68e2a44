"""Noise that differs from soak to soak is known for each of them."""

import numpy as np
import pytest
from made_worlds import NOISES, NULLS, run_of

from inertial.estimation.loudness import loudness_of

SEED = 5_900_000


def test_noise_that_grows_with_temperature_is_known_for_each_soak() -> None:
    run = run_of(NOISES["hot_x4"], SEED)
    loud = loudness_of(run.model())
    assert loud is not None
    warm = np.median(run.lot.state.temperature, axis=0)
    cold, hot = (float(np.median(loud[warm == each])) for each in (warm[np.argmin(warm)], warm[np.argmax(warm)]))
    # of the fast part alone the ratio is four; what is slower than a soak does not grow
    assert 1.7 < hot / cold < 4.5
    assert np.mean(loud**2) == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["B30", "K4", "t3", "lengths", "units_spread", "one_unit", "B300"])
def test_soaks_of_equal_noise_are_not_told_apart(name: str) -> None:
    assert [loudness_of(run_of(NULLS[name], SEED + seed).model()) for seed in range(4)] == [None] * 4
