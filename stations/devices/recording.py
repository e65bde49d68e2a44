"""A recording of test equipment, and the result file that it comes from: a MATLAB file with a rate, a unit and slots."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.io import loadmat

from schemas.errors import StationError, StationRefused

Array = NDArray[np.float64]
REFERENCE = "@reference"
REFERENCE_SLOT = 999
NEEDED = ("rate_hz", "reference", "reference_rate_hz", "reference_unit")
STANDARD_GRAVITY = {"g": 1.0, "m/s^2": 9.80665}


class RecordingSpoilt(StationError):
    """A recording that is of no use, such as a missed trigger or a clipped reference; it is discarded and taken again."""


@dataclass(frozen=True)
class Recording:
    """The outputs of the units by slot, and the reference sensor, each on its own time base.

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


def read_recording(path: Path, slots: list[int], name: str, units: Mapping[str, float] = STANDARD_GRAVITY) -> Recording:
    """The recording in a result file; a file without rate or unit is refused.

    Parameters
    ----------
    slots : whose channels are wanted; one that is not there is left out
    name : of the equipment, for messages
    units : allowed units of the reference, with their number in the one that is returned
    """
    try:
        content: dict[str, Any] = loadmat(path, simplify_cells=True)
    except (OSError, ValueError, NotImplementedError) as problem:  # the last: files of MATLAB 7.3, which are HDF5
        raise StationRefused(f"{name}: result file {path.name} cannot be read ({problem}); check the share") from None
    missing = [key for key in NEEDED if key not in content]
    if missing:
        raise StationRefused(
            f"{name}: result file {path.name} lacks {', '.join(missing)}; set up the export of the recorder"
        )
    unit = str(content["reference_unit"])
    if unit not in units:
        raise StationRefused(f"{name}: reference in '{unit}', {' or '.join(units)} is needed; correct the set-up")
    outputs = {
        slot: np.atleast_2d(np.asarray(content[f"slot_{slot}"], dtype=np.float64))
        for slot in slots
        if f"slot_{slot}" in content
    }
    reference = np.asarray(content["reference"], dtype=np.float64) / units[unit]
    return Recording(outputs, float(content["rate_hz"]), reference, float(content["reference_rate_hz"]))
