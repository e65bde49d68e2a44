"""How often an axis gets shares of 1/f and walk of its own, and a lot a noise for each soak, where they need it and where not."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "worlds"), str(HERE.parent)]
sys.path.append(str(HERE))  # last: tests have modules of the same names

from decision_parts import rate, run_of  # noqa: E402
from noise import Noise  # noqa: E402
from tables import NOISES, NULLS  # noqa: E402
from world import World  # noqa: E402

SEED = 43_700_000
EQUAL = ("B30", "K4", "white", "B300", "t3", "units_spread", "rest20")


def own_shares(runs: int, first: int) -> Iterator[str]:
    """Axes with shares of their own, in lots that need none and in lots with telegraph noise."""
    worlds = {"axes of lots with one kind of noise": [NULLS[name] for name in EQUAL]}
    for stay in (200.0, 900.0):
        told = f"axes of lots of white noise in which 15 % jump by 150 µg, {stay:g} s at a level"
        worlds[told] = [World(noise=Noise(white=100.0, flicker=3.0, telegraph=(150.0, stay, 0.15)))]
    for told, kinds in worlds.items():
        noises = [run_of(world, SEED + first + seed).model().noise for world in kinds for seed in range(runs)]
        axes = sum(noise.scale.size for noise in noises)
        yield f"{told}: {rate(sum(len(noise.shares.by_block) for noise in noises), axes)} with shares of their own"


def louder(runs: int, first: int) -> Iterator[str]:
    """Lots with a noise for each soak."""
    from inertial.estimation.loudness import loudness_of

    for names, told in (
        (EQUAL, "lots with equal soaks"),
        (("hot_x2",), "lots whose fast noise grows by two"),
        (("hot_x4",), "lots whose fast noise grows by four"),
    ):
        lots = [
            loudness_of(run_of({**NULLS, **NOISES}[name], SEED + first + seed).model())
            for name in names
            for seed in range(runs)
        ]
        yield f"{told}: {rate(sum(one is not None for one in lots), len(lots))} have a noise for each soak"
