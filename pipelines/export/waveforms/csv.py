"""Comma-separated values: time in s and a column for each channel, the unit in brackets."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from pipelines.export.waveforms.channel import Channel

NAME, SUFFIX, ONE_CLOCK = "csv", ".csv", True


def write(channels: Sequence[Channel], path: Path) -> None:
    """Write the channels with 17 digits, which represent every double exactly."""
    columns = {"time [s]": channels[0].time}
    columns |= {f"{one.name} [{one.unit}]": one.values for one in channels}  # noqa: PD011 - of a channel
    pd.DataFrame(columns).to_csv(path, index=False, float_format="%.17g")
