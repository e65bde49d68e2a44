"""A channel of a recording: evenly spaced samples with unit and interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ACCELERATIONS = ("g", "m/s^2")


@dataclass(frozen=True)
class Channel:
    """A channel.

    Attributes
    ----------
    name, unit : texts in the file · group : channels of one clock, ``units`` or ``reference``
    values : (n,) · interval_s, start_s : s
    axis : 0 to 2, in the axes of the units
    """

    name: str
    unit: str
    group: str
    values: NDArray[np.float64]
    interval_s: float
    axis: int
    start_s: float = 0.0

    @property
    def time(self) -> NDArray[np.float64]:
        """(n,), s."""
        return np.asarray(self.start_s + self.interval_s * np.arange(len(self.values)), dtype=np.float64)
