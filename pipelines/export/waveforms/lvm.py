"""LabVIEW measurement file: text with ``Delta_X`` and the unit of each channel in the header."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipelines.export.waveforms.channel import Channel

NAME, SUFFIX, ONE_CLOCK = "lvm", ".lvm", True
END = "***End_of_Header***"


def write(channels: Sequence[Channel], path: Path) -> None:
    """Write the channels with 17 digits."""
    count = len(channels)
    head = [
        "LabVIEW Measurement",
        "Writer_Version\t2",
        "Reader_Version\t2",
        "Separator\tTab",
        "Decimal_Separator\t.",
        "Multi_Headings\tNo",
        "X_Columns\tOne",
        "Time_Pref\tRelative",
        END,
        "",
        f"Channels\t{count}",
        "Samples" + "".join(f"\t{len(one.values)}" for one in channels),
        "Y_Unit_Label" + "".join(f"\t{one.unit}" for one in channels),
        "X_Dimension" + "\tTime" * count,
        "X0" + "".join(f"\t{one.start_s:.17g}" for one in channels),
        "Delta_X" + "".join(f"\t{one.interval_s:.17g}" for one in channels),
        END,
        "X_Value" + "".join(f"\t{one.name}" for one in channels) + "\tComment",
    ]
    rows = np.column_stack([channels[0].time, *(one.values for one in channels)])
    body = ["\t".join(f"{value:.17g}" for value in row) for row in rows.tolist()]
    path.write_text("\n".join([*head, *body, ""]), encoding="utf-8")
