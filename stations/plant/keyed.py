"""Random numbers of an instant: a repeated reading gives the same number, and a reading changes no state."""

import numpy as np
from numpy.typing import NDArray


def keyed_normal(seed: int, channel: int, tick: int, n: int) -> NDArray[np.float64]:
    """``n`` standard normal numbers that depend on seed, channel and tick only."""
    return np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, channel, tick])).standard_normal(n)
