"""WAV, 64-bit float: the rate and the channels. It states neither unit nor scale, and only whole rates."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipelines.export.waveforms.channel import Channel
from schemas.errors import WrongUse

NAME, SUFFIX, ONE_CLOCK = "wav", ".wav", True


def write(channels: Sequence[Channel], path: Path) -> None:
    """Write the channels in order; a rate that is not a whole number is refused."""
    from scipy.io import wavfile  # a third of a second

    rate = 1.0 / channels[0].interval_s
    if abs(rate - round(rate)) > 1e-6 * rate:
        raise WrongUse(f"waveforms: {rate:.6g} Hz, a WAV file has whole rates only; choose another format")
    wavfile.write(path, round(rate), np.column_stack([one.values for one in channels]))
