"""MATLAB, version 5: a vector for each channel, ``time`` in s, and the units as texts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pipelines.export.waveforms.channel import Channel

NAME, SUFFIX, ONE_CLOCK = "mat", ".mat", True


def write(channels: Sequence[Channel], path: Path) -> None:
    """Write the channels; blanks in names become underscores."""
    from scipy.io import savemat  # a third of a second

    content: dict[str, Any] = {"time": channels[0].time}
    for one in channels:
        name = "".join(letter if letter.isalnum() else "_" for letter in one.name)
        content |= {name: one.values, f"{name}_unit": one.unit}
    savemat(path, content, oned_as="column")
