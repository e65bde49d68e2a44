"""Waveforms of a record as files of other programs: each module of this package writes one format and is found here.

A module states ``NAME``, ``SUFFIX`` of its files, ``ONE_CLOCK`` (all channels share one interval and length), and
``write(channels, path)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Protocol, cast

from pipelines.export.waveforms.channel import Channel
from schemas.errors import WrongUse, did_you_mean

__all__ = ["WRITERS", "Channel", "write_waveforms", "writer_of"]


class Writer(Protocol):
    """A module that writes one format."""

    NAME: str
    SUFFIX: str
    ONE_CLOCK: bool

    def write(self, channels: Sequence[Channel], path: Path) -> None:
        """Writes the channels to a file."""
        ...


def _writers_by_name() -> dict[str, Writer]:
    modules = [
        cast("Writer", import_module(f"{__name__}.{info.name}"))
        for info in iter_modules(__path__)
        if info.name != "channel"
    ]
    return {module.NAME: module for module in modules}


WRITERS: dict[str, Writer] = _writers_by_name()


def writer_of(form: str) -> Writer:
    """The writer of a format; an unknown format is refused with similar names."""
    if form not in WRITERS:
        raise WrongUse(f"waveforms: no format is called '{form}'; {did_you_mean(form, WRITERS)}")
    return WRITERS[form]


def write_waveforms(form: str, channels: Sequence[Channel], path: Path) -> list[Path]:
    """Write the channels and return the paths: one file, or one for each clock where the format holds only one.

    Raises
    ------
    WrongUse
        The format is not known, there is no channel, or a library is missing.
    """
    writer = writer_of(form)
    if not channels:
        raise WrongUse("waveforms: no channel, at least one is needed; name another record")
    clocks = list(dict.fromkeys((one.interval_s, len(one.values), one.group) for one in channels))
    shared = len({(interval, count) for interval, count, _ in clocks}) == 1
    if shared or not writer.ONE_CLOCK:
        writer.write(channels, path)
        return [path]
    written: list[Path] = []
    for interval, count, group in clocks:
        own = [one for one in channels if (one.interval_s, len(one.values), one.group) == (interval, count, group)]
        place = path.with_name(f"{path.stem}_{group}{path.suffix}")
        writer.write(own, place)
        written.append(place)
    return written
