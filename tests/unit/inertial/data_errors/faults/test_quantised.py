"""Noise of the samples that grows with temperature is no converter with coarse steps."""

import numpy as np
import pytest
from made_worlds import BASE, Noise, World, make

from pipelines.tables.sound_lot import sound_lot


@pytest.mark.parametrize("seed", range(12))
def test_scatter_that_follows_the_temperature_is_not_quantised(seed: int) -> None:
    made = make(World(noise=Noise(white=150.0, flicker=10.0)), 5_800_000 + seed)
    dwells = made.dwells.copy()
    rng = np.random.default_rng(seed)
    louder = np.exp((dwells["unit_C"].to_numpy() - 25.0) / 40.0)
    for axis in "xyz":
        sigma = dwells[f"sd_{axis}"].median()
        own = sigma * louder
        extra = np.sqrt(np.maximum(own**2 - sigma**2, 0.0) / dwells["n"])
        dwells[f"out_{axis}"] += extra * rng.standard_normal(len(dwells))
        dwells[f"sd_{axis}"] = own * (1.0 + rng.standard_normal(len(dwells)) / np.sqrt(2.0 * dwells["n"]))
    assert dwells["sd_x"].max() > 3.0 * dwells["sd_x"].min()
    _, faults, _ = sound_lot(dwells, made.history, BASE)
    assert [fault.name for fault in faults] == []
