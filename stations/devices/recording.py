"""A recording of test equipment: the outputs of the units by slot, and the reference sensor, each on its own time base."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from schemas.errors import StationError

Array = NDArray[np.float64]
REFERENCE = "@reference"
REFERENCE_SLOT = 999


class RecordingSpoilt(StationError):
    """A recording that is of no use, such as a missed trigger or a clipped reference; it is discarded and taken again."""


@dataclass(frozen=True)
class Recording:
    """One recording.

    Attributes
    ----------
    outputs : (n, 3) by slot, unit of the output
    rate_hz : nominal rate of the outputs, Hz; a device with a clock of its own departs from it
    reference : (m, 3), g, in the axes of the units
    reference_rate_hz : of the reference, Hz
    """

    outputs: dict[int, Array]
    rate_hz: float
    reference: Array
    reference_rate_hz: float
    figures: dict[str, float] = field(default_factory=dict[str, float])

    def reference_frame(self, record: int, start: float) -> pd.DataFrame:
        """The reference as samples, under a name that no serial can have."""
        n = len(self.reference)
        return pd.DataFrame(
            {
                "unit": pd.Series([REFERENCE] * n, dtype="str"),
                "slot": np.full(n, REFERENCE_SLOT, dtype=np.int64),
                "record": np.full(n, record, dtype=np.int64),
                "kind": pd.Series(["procedure"] * n, dtype="str"),
                "time_s": start + (np.arange(n) + 1.0) / self.reference_rate_hz,
                "x": self.reference[:, 0],
                "y": self.reference[:, 1],
                "z": self.reference[:, 2],
            }
        )
