"""Result files of test equipment: MATLAB files with a rate, a unit and a channel for every slot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from schemas.errors import StationRefused
from stations.devices.recording import Recording

NEEDED = ("rate_hz", "reference", "reference_rate_hz", "reference_unit")
STANDARD_GRAVITY = {"g": 1.0, "m/s^2": 9.80665}


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
