"""The result of a reader: a table of columns, and the statements of the file about them."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from schemas.errors import DataRejected, WrongUse, did_you_mean
from schemas.foreign import shown

_BRACKETS = re.compile(r"[\[(]\s*([^\[\]()]{1,12}?)\s*[\])]\s*$")
_MOST_LISTED = 12


@dataclass(frozen=True)
class Content:
    """A table of a file.

    table : columns, named as in the file
    remarks : information for the user, such as a preamble
    units : column → unit, as the file states it
    interval_s : sample interval that the file states, s; None if it states none
    lines : of a text, each file's name and the line of each of its rows, from 0, file after file; empty if unknown
    words : of a text, columns as they were written, where numbers do not tell it: serial numbers such as 007, 1e5, NA
    """

    table: pd.DataFrame
    remarks: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    interval_s: float | None = None
    lines: tuple[tuple[str, Sequence[int]], ...] = ()
    words: Mapping[str, Sequence[Any]] = field(default_factory=dict[str, Sequence[Any]])

    def named(self, column: str) -> pd.Series:
        """A column that holds names, as it was written."""
        return pd.Series(self.words[column], name=column) if column in self.words else self.table[column]

    def row(self, index: int) -> str:
        """A row (from 0) for messages: its number among the rows of data from 1, and its line in an editor where it is known."""
        before = 0
        for name, lines in self.lines:
            if index < before + len(lines):
                file = f" of {name}" if len(self.lines) > 1 else ""
                return f"row {index + 1} (line {lines[index - before] + 1}{file})"
            before += len(lines)
        return f"row {index + 1}"


_ENDINGS = {
    **{unit: unit for unit in ("s", "ms", "us", "µs", "ns", "g", "mg", "V", "mV", "LSB")},
    **dict.fromkeys(("m_s2", "m_s_2", "mps2"), "m/s^2"),
}


def unit_in(name: str) -> str:
    """The unit at the end of a column's name, in brackets or behind an underscore (``time_ms``, ``out_g``); empty for none."""
    match = _BRACKETS.search(name)
    if match:
        return match[1]
    return next((unit for ending, unit in _ENDINGS.items() if name.endswith(f"_{ending}")), "")


def begins_with(magic: bytes) -> Callable[[bytes], bool]:
    """A function that recognises the files of a format by their first bytes."""
    return lambda data: data.startswith(magic)


INERTIAL = ("acc", "imu")
"""Words of the groups that are listed first: they may hold an accelerometer."""


def chosen(groups: Sequence[tuple[str, int]], group: str, where: str, missing: str = "") -> str:
    """The group of channels to read: the given group, or the only group.

    Parameters
    ----------
    groups : name and count of samples of each group, whose channels share a clock.
    group : its name; empty if not given.
    missing : what the file lacks where there is no group.

    Raises
    ------
    DataRejected
        There is no group.
    WrongUse
        There are several and none is named, or none has the name.
    """
    if not groups:
        raise DataRejected(f"{where}: {missing}, one is needed; check the file")
    names = [name for name, _ in groups]
    if group:
        if group not in names:
            raise WrongUse(f"{where}: no group is called '{shown(group)}'; {did_you_mean(group, names)}")
        return group
    if len(names) == 1:
        return names[0]
    likely = sorted(groups, key=lambda pair: not any(word in pair[0].lower() for word in INERTIAL))
    listed = ", ".join(f"'{shown(name)}' ({count} samples)" for name, count in likely[:_MOST_LISTED])
    more = "" if len(groups) <= _MOST_LISTED else f" and {len(groups) - _MOST_LISTED} more"
    raise WrongUse(
        f"{where}: {len(names)} groups of channels with clocks of their own, one is needed: {listed}{more}; "
        "choose one with --set group=NAME"
    )
