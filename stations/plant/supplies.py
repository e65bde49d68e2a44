"""Supplies of the slots over their nominal voltage, and what the reader's meter says of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from schemas.simulation import Simulation
from stations.plant.device import stream

Array = NDArray[np.float64]

READING_NOISE = 2e-5  # relative, of one reading of the meter
SLOWEST_S, FASTEST_S = 6.0 * 3600.0, 900.0  # periods of the drift: a regulator follows the temperature of the room
WAVES = 8


class Supplies:
    """A regulator for each slot: an offset that stays, a drift that is another in each run, and a set ratio of all.

    The drift is a sum of waves, so that its value at any instant does not depend on the steps in which the time passes. Outputs
    that do not follow their supply reject changes of this size: theirs has no drift.
    """

    def __init__(self, sim: Simulation, slots: Sequence[int], run: np.random.Generator, *, followed: bool) -> None:
        own = list(slots)
        self.offset = 1.0 + sim.supply_spread * stream(sim.seed, "supply").standard_normal(64)[own]
        self.factor = np.ones(len(own))
        self._meter = 1.0 + 1e-6 * sim.supply_reading_ppm * float(stream(sim.seed, "supply meter").standard_normal())
        self._amplitude = sim.supply_drift * math.sqrt(2.0 / WAVES) if followed else 0.0
        self._phase = run.uniform(0.0, 2.0 * math.pi, (64, WAVES))[own]
        self._rate = 2.0 * math.pi / np.geomspace(SLOWEST_S, FASTEST_S, WAVES)

    def drift(self, time: Array) -> Array | float:
        """Relative departure from the offset at instants (n,), s, of every slot, (n, slots)."""
        if self._amplitude == 0.0:
            return 0.0
        return self._amplitude * np.sin(np.asarray(time)[:, None, None] * self._rate + self._phase).sum(axis=-1)

    def reading(self, now: float, normal: Array) -> Array:
        """Readings of the meter over the nominal voltage at ``now`` s, (slots,), from standard normal numbers."""
        true = self.offset * (1.0 + np.reshape(self.drift(np.array([now])), (-1,)))
        return self._meter * self.factor * (true + READING_NOISE * normal)
