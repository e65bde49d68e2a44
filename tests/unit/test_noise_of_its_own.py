"""Noise that differs from soak to soak, and axes that wander by themselves: their shares and loudness."""

import sys
from pathlib import Path

import numpy as np
import pytest

from inertial.criticism.examination import ExaminedRun
from inertial.estimation.loudness import loudness_of
from inertial.estimation.noise_shares import Shares
from pipelines.tables.dwells import lot_of, measured

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from noise import Noise
from tables import NOISES, NULLS
from world import World, make

BASE = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
SEED = 5_900_000


def run_of(world: World, seed: int) -> ExaminedRun:
    made = make(world, SEED + seed)
    return ExaminedRun(lot_of(measured(made.dwells, made.history), square=False), BASE)


def test_shares_of_some_blocks_keep_those_of_their_own() -> None:
    shares = Shares(1.0, 2.0, own=((1, 10.0, 20.0), (4, 30.0, 0.0)))
    assert shares.common == Shares(1.0, 2.0)
    assert (shares.of_block(4), shares.of_block(0)) == (Shares(30.0, 0.0), Shares(1.0, 2.0))
    assert shares.pick([4, 0, 1]) == Shares(1.0, 2.0, own=((0, 30.0, 0.0), (2, 10.0, 20.0)))
    assert shares.pick([0, 2]) == Shares(1.0, 2.0)
    assert shares.times(2.0, 3.0) == Shares(2.0, 6.0, own=((1, 20.0, 60.0), (4, 60.0, 0.0)))


@pytest.mark.parametrize("seed", range(3))
def test_an_axis_that_wanders_by_itself_has_shares_of_its_own(seed: int) -> None:
    made = make(World(noise=Noise(white=100.0, flicker=0.0)), SEED + 10 + seed)
    dwells = made.dwells.copy()
    wanders = (dwells["unit"] == dwells["unit"].unique()[2]).to_numpy()
    steps = np.random.default_rng(seed).standard_normal(int(wanders.sum()))
    dwells.loc[wanders, "out_y"] += 40e-6 * np.cumsum(steps)
    lot = lot_of(measured(dwells, made.history), square=False)
    noise = ExaminedRun(lot, BASE).model().noise
    (own,) = noise.shares.own
    assert own[0] == 3 * 2 + 1
    assert own[1] + own[2] > 30.0 * max(noise.shares.flicker + noise.shares.walk, 1.0)


def test_equal_axes_have_the_shares_of_their_lot() -> None:
    every = [run_of(NULLS[name], seed).model().noise.shares.own for name in ("B30", "K4", "white") for seed in range(3)]
    assert every == [()] * len(every)


def test_noise_that_grows_with_temperature_is_known_for_each_soak() -> None:
    run = run_of(NOISES["hot_x4"], 0)
    loud = loudness_of(run.model())
    assert loud is not None
    warm = np.median(run.lot.state.temperature, axis=0)
    cold, hot = (float(np.median(loud[warm == each])) for each in (warm[np.argmin(warm)], warm[np.argmax(warm)]))
    # of the fast part alone the ratio is four; what is slower than a soak does not grow
    assert 1.7 < hot / cold < 4.5
    assert np.mean(loud**2) == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["B30", "K4", "t3", "lengths", "units_spread", "one_unit", "B300"])
def test_soaks_of_equal_noise_are_not_told_apart(name: str) -> None:
    assert [loudness_of(run_of(NULLS[name], seed).model()) for seed in range(4)] == [None] * 4
