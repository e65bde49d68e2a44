"""Inspection of a table of dwells in the exchange format, which needs no import: ``diagnose`` reads it as it is."""

from __future__ import annotations

import shlex
from pathlib import Path

import pandas as pd

from inertial.counts import number_of
from pipelines.importers.exchange import read_dwells
from pipelines.importers.guesses import Guess, Guesses
from pipelines.tables.dwell_columns import ANGLES, DEVIATIONS, FORCE, KNOWN
from schemas.errors import TumblelineError

FORMAT = "the exchange format"
MEANINGS = {
    "unit": "unit", "dwell": "dwell", "time_s": "time", "out_x": "x", "out_y": "y", "out_z": "z",
    **dict.fromkeys(FORCE, "reference force"), **dict.fromkeys(ANGLES, "reference angle"),
    **{name: f"sd_{name[-1]}" for name in DEVIATIONS},
}  # fmt: skip


def guesses_of_dwells(table: pd.DataFrame) -> Guesses:
    """The meanings of the columns, which the format states; a further column of numbers is a recorded quantity."""
    columns: dict[str, Guess] = {}
    for name in map(str, table.columns):
        if name in MEANINGS or name in KNOWN:
            columns[name] = Guess(MEANINGS.get(name, "recorded quantity"), "its name")
        else:
            is_number = table[name].dtype.kind in "fiu"
            columns[name] = Guess("covariate" if is_number else "", "further numbers" if is_number else "")
    return Guesses(columns, Guess("s", FORMAT), _output(table))


def _output(table: pd.DataFrame) -> Guess:
    """The unit of the output, if the table states one."""
    stated = sorted({str(unit) for unit in table["out_unit"].dropna()}) if "out_unit" in table else []
    return Guess(stated[0], "column out_unit") if len(stated) == 1 else Guess("", "")


def content_of_dwells(table: pd.DataFrame) -> str:
    """What the table holds, as a sentence."""
    names = set(map(str, table.columns))
    if set(FORCE) <= names:
        reference = "the force on each axis"
    elif set(ANGLES) <= names:
        reference = "the angles of the table"
    else:
        reference = "none: only the magnitude of gravity is known"
    units = number_of(int(table["unit"].nunique()), "unit")
    return f"a table of dwells in {FORMAT}: {units}, {number_of(len(table), 'dwell')}; reference: {reference}"


def command_of_dwells(path: Path) -> str:
    """The command for the table."""
    return shlex.join(["tumbleline", "diagnose", str(path)])


def problems_of_dwells(path: Path) -> list[str]:
    """Why ``diagnose`` would refuse the table; empty where it does not."""
    try:
        read_dwells(path)
    except TumblelineError as problem:
        return [str(problem)]
    return []
