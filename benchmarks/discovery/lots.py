"""Lots dwell by dwell in several worlds of noise and of references, scored once each by the product's engine.

No lot has a fault of the data, and none is searched for.
The physics and the noise are written here and in :mod:`pipelines.demo.archive_lots`; neither knows a column of a fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks.discovery.physics import added
from inertial.discovery.scores import LotScores, scores_of
from pipelines.demo.archive_lots import EFFECTS, WHITE_UG, Line
from pipelines.tables.dwells import lot_of, measured

Array = NDArray[np.float64]
WANDER_UG = 36.0
FLOOR_UG = float(np.hypot(WHITE_UG, WANDER_UG))  # of a dwell


@dataclass(frozen=True)
class World:
    """How lots differ from what the estimator assumes; the names are printed.

    rests : rad, how far the table rests off its targets, each time anew · walk : µg/√s · tails : degrees of freedom of
        Student's t, 0 for normal · thermometer : K by soak, alike for all units · with_force : growth of the noise with the force
    common : µg of a noise that all units of a lot share
    """

    name: str
    rests: float = 0.0
    walk: float = 0.0
    tails: int = 0
    louder: float = 1.0
    thermometer: float = 0.0
    with_force: float = 0.0
    common: float = 0.0


WORLDS = (
    World("plain"),
    World("table rests 20 µrad off", rests=20e-6),
    World("walk 4 µg/√s", walk=4.0),
    World("t3 tails", tails=3),
    World("noise 1.5 × the stated", louder=1.5),
    World("thermometer 0.1 K by soak", thermometer=0.1),
    World("noise grows with force", with_force=2.0),
    World("noise common to all units", common=15.0),
)


def bank(world: World, count: int, seed: int) -> list[LotScores]:
    """Scores of lots of a world, with nothing hidden in them."""
    lots = Lots(world, seed)
    return [lots.scored() for _ in range(count)]


class Lots:
    """Lots of a world, one after the other."""

    def __init__(self, world: World, seed: int) -> None:
        self._world, self._rng = world, np.random.default_rng([seed, 977])
        self._line = Line(seed, hidden=None, rests=world.rests, wander=WANDER_UG)

    def scored(self, effect: str = "", size: Array | None = None) -> LotScores:
        """The scores of the next lot.

        Parameters
        ----------
        effect : hidden in its devices · size : (units, 3), of it, in floors
        """
        dwells, _ = self._line.lot("s")
        if size is not None:
            _hide(dwells, effect, 1e-6 * FLOOR_UG * size)
        with threadpool_limits(1):
            return _scored(dwells, self._world, self._rng)


def _hide(dwells: pd.DataFrame, effect: str, size: Array) -> None:
    """Add an effect to the outputs; the rows of a unit stand together, in order of time, and all units have as many."""
    names, forces = ([f"{what}_{axis}" for axis in "xyz"] for what in ("out", "force"))
    out, force = (dwells[of].to_numpy(dtype=float).reshape(len(size), -1, 3) for of in (names, forces))
    warm, time = (dwells[of].to_numpy(dtype=float).reshape(len(size), -1) for of in ("unit_C", "time_s"))
    more = [each * added(effect, *there) for each, *there in zip(size, force, warm, time, strict=True)]
    dwells[names] = (out + np.array(more)).reshape(-1, 3)


def _scored(dwells: pd.DataFrame, world: World, rng: np.random.Generator) -> LotScores:
    names = [f"out_{axis}" for axis in "xyz"]
    units = dwells["unit"].unique()
    n = len(dwells) // len(units)
    out = dwells[names].to_numpy().reshape(len(units), n, 3)
    time = dwells["time_s"].to_numpy()[:n]
    steps = np.sqrt(np.diff(time, prepend=0.0))[:, None]
    out = out + 1e-6 * world.walk * np.cumsum(steps * rng.standard_normal(out.shape), axis=1)
    if world.tails:
        out = out + 1e-6 * WHITE_UG * rng.standard_t(world.tails, out.shape)
    if world.louder > 1.0:
        out = out + 1e-6 * WHITE_UG * np.sqrt(world.louder**2 - 1.0) * rng.standard_normal(out.shape)
    if world.with_force:
        out = out + 1e-6 * WHITE_UG * world.with_force * np.abs(out) * rng.standard_normal(out.shape)
    if world.common:
        out = out + 1e-6 * world.common * rng.standard_normal((n, 3))
    if world.thermometer:
        wrong = world.thermometer * rng.standard_normal(3)[np.repeat(np.arange(3), n // 3)]
        dwells["unit_C"] = dwells["unit_C"] + np.tile(wrong, len(units))
    dwells[names] = out.reshape(-1, 3)
    return scores_of(lot_of(measured(dwells, None)), EFFECTS)
