"""The slow noise of simulated units apart from the white one: what a bias as the mean of its record is the bias of."""

from collections.abc import Generator
from contextlib import contextmanager

import numpy as np

from stations.plant import world
from stations.plant.noise import UnitNoise

Array = np.ndarray


class ApartNoise(UnitNoise):
    """Noise that keeps the white part of the last samples apart."""

    def _white(self, z: Array, rate: float) -> Array:
        self.white = super()._white(z, rate).copy()
        return self.white.copy()


class _Kept(ApartNoise):
    """Noise that sums its slow part over the samples."""

    def sample(self, n: int, rate: float, temperature: Array | None = None) -> Array:
        total = super().sample(n, rate, temperature)
        before = getattr(self, "sums", (0.0, 0))
        self.sums = before[0] + (total - self.white).sum(axis=0), before[1] + n
        return total


@contextmanager
def kept() -> Generator[list[_Kept]]:
    """Within it, plants keep the slow noise of what is sampled; the noises of those that were made."""
    made: list[_Kept] = []

    def keeping(*given: object) -> _Kept:
        made.append(_Kept(*given))  # type: ignore[arg-type]
        return made[-1]

    world.UnitNoise = keeping  # type: ignore[misc,assignment]
    try:
        yield made
    finally:
        world.UnitNoise = UnitNoise  # type: ignore[misc]


def mean_of(noises: list[_Kept]) -> Array:
    """Mean (units, 3), g, of the slow noise over all samples of the plants."""
    sums = [noise.sums for noise in noises if hasattr(noise, "sums")]
    return np.sum([total for total, _ in sums], axis=0) / sum(count for _, count in sums)
