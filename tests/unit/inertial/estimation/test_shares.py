"""Shares of slow noise: those of some blocks, axes that wander by themselves, and what few dwells leave open."""

import numpy as np
import pytest
from made_worlds import BASE, NULLS, Noise, World, make, run_of

from inertial.criticism.examination import ExaminedRun
from inertial.estimation.noise_shares import Shares
from inertial.estimation.shares import plausible_shares
from pipelines.tables.dwells import lot_of, measured

SEED = 5_900_000


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
    runs = [run_of(NULLS[name], SEED + seed) for name in ("B30", "K4", "white") for seed in range(3)]
    assert [run.model().noise.shares.own for run in runs] == [()] * 9


def test_plausible_shares_are_those_that_the_likelihood_leaves_with_weights_that_add_up() -> None:
    plausible = plausible_shares(
        lambda s: 40.0 * (np.log10(s.flicker + 1e-2) - 1.0) ** 2 + 1e3 * (s.walk > 0.02), Shares(10.0)
    )
    assert sum(weight for _, weight in plausible) == pytest.approx(1.0)
    assert max(plausible, key=lambda one: one[1])[0].flicker == pytest.approx(10.0)
    assert {round(np.log10(s.flicker), 1) for s, _ in plausible} == {0.5, 1.0, 1.5}
    assert all(s.walk <= 0.1 for s, _ in plausible)
