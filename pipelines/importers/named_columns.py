"""Columns of an unknown file whose names alone tell what they are: those of the exchange format, serials, numbers of dwells."""

import re
from collections.abc import Collection, Mapping

import numpy as np
import pandas as pd

from inertial.arrays import Array, Flags
from inertial.quantities import RECORDED
from pipelines.importers.mapping import MEANINGS
from pipelines.importers.stated_units import output_unit

OF_DWELLS = ("n",)
"""Names that a table of samples has as well, for something else."""
MEANING_OF: dict[str, str] = {
    "time_s": "time",
    "dwell": "dwell",
    **{row.column: row.column for row in RECORDED if not row.attribute},  # covariates that are known
    **{column: meaning for meaning, column in MEANINGS.items()},
}
"""Meanings of the columns of the exchange format but for unit and outputs."""
_SERIAL = re.compile(r"^(?:unit|serial|sn|s/n|dut|device)(?:[ _.-]?(?:no|nr|number|id))?\.?$", re.IGNORECASE)
_NUMBER = re.compile(r"^(?:dwell|pos|position|no|nr|number|index|step)(?:[ _.-]?(?:no|nr|number))?\.?$", re.IGNORECASE)


def is_of_serials(name: str) -> bool:
    """Whether a column is called like one of serial numbers."""
    return _SERIAL.match(name) is not None


def serials(table: pd.DataFrame) -> str:
    """The column of serial numbers; empty if there is none. Units of measurement are none, nor are numbers of the rows."""
    for name in (str(column) for column in table.columns if is_of_serials(str(column))):
        distinct = table[name].unique()
        few = len(distinct) == 1 or 2 * len(distinct) <= len(table)
        if few and table[name].notna().all() and not all(output_unit(str(value)) for value in distinct):
            return name
    return ""


def of_one_unit(table: pd.DataFrame, serial: str) -> Flags:
    """Which steps from row to row (n − 1,) stay in one unit; all without a column of serial numbers."""
    if not serial:
        return np.ones(max(len(table) - 1, 0), dtype=bool)
    units = table[serial].astype(str).to_numpy(dtype=object)
    return np.asarray(units[1:] == units[:-1], dtype=bool)


def numbers_of_dwells(numeric: Mapping[str, Array], inside: Flags, free: Collection[str]) -> str:
    """The free column that numbers the dwells of each unit, one dwell in each row; empty if no column does."""
    for name in free:
        steps = np.diff(numeric[name])[inside] if name in numeric and _NUMBER.match(name) else np.zeros(0)
        if steps.size and bool(np.all((steps >= 1.0) & (steps == np.rint(steps)))):
            return name
    return ""
