"""Universal file, dataset 58: time records (function type 1) in binary, which keeps every double; the interval has 6 digits.

Source: SDRC Universal File Formats, dataset 58: abscissa type 17 is time, ordinate type 12 acceleration, 0 unknown.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipelines.export.waveforms.channel import ACCELERATIONS, Channel
from schemas.library import library

NAME, SUFFIX, ONE_CLOCK = "uff58", ".uff", False
TIME, ACCELERATION, UNKNOWN = 17, 12, 0
DOUBLE = 4  # ordinate of double precision, real


def write(channels: Sequence[Channel], path: Path) -> None:
    """Write the channels; the name is identification line 1, the axis the direction of the response."""
    pyuff = library("pyuff", "uff", "waveforms: a universal file (UFF)")
    path.unlink(missing_ok=True)
    file = pyuff.UFF(str(path))
    for number, one in enumerate(channels, start=1):
        known = ACCELERATION if one.unit in ACCELERATIONS else UNKNOWN
        content = {
            "type": 58, "binary": 1, "func_type": 1, "rsp_node": number, "rsp_dir": one.axis + 1, "ref_node": 0, "ref_dir": 0,
            "data": np.asarray(one.values, dtype=np.float64), "x": one.time, "num_pts": len(one.values), "id1": one.name,
            "rsp_ent_name": "NONE", "ref_ent_name": "NONE", "abscissa_spacing": 1, "abscissa_min": one.start_s,
            "abscissa_inc": one.interval_s, "abscissa_spec_data_type": TIME, "abscissa_axis_units_lab": "s",
            "ordinate_spec_data_type": known, "ordinate_axis_units_lab": one.unit, "orddenom_spec_data_type": UNKNOWN,
            "ord_data_type": DOUBLE,
        }  # fmt: skip
        with warnings.catch_warnings():  # pyuff leaves the file to the collector; its "overwrite" loses binary samples
            warnings.simplefilter("ignore", ResourceWarning)
            file.write_sets(content, "add")
