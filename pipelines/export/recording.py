"""A recording of raw output as arrays: times, outputs, conditions and, where it is known, the true force."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.counts import number_of
from inertial.quantities import BY_COLUMN, FORCE_COLUMNS
from inertial.state import ALL_AXES, State
from pipelines.archive import Run
from pipelines.importers import files
from pipelines.importers.clocks import unit_stated
from pipelines.importers.stated_units import column_name, output_unit
from pipelines.importers.values import as_numbers, finite_column, is_moment, seconds
from pipelines.stages.uncertainty.budget_terms import archived_terms
from schemas.errors import DataRejected, WrongUse
from schemas.foreign import shown
from schemas.units import AXES

TIME = "time_s"
USUAL = (("x", "y", "z"), ("out_x", "out_y", "out_z"))


@dataclass(frozen=True)
class CorrectableRecording:
    """Samples in order of time.

    time : (n,), s; output : (n, m), output unit
    state : conditions of the samples; its force is zero
    known : (n, 3), g, the true force; NaN where it is not known
    name : file name, for messages
    """

    time: Array
    output: Array
    state: State
    known: Array
    name: str


def read_recording(
    path: Path,
    columns: Sequence[str],
    *,
    time: str = "",
    rate_hz: float | None = None,
    axes: Sequence[int] = ALL_AXES,
    unit: str = "",
) -> CorrectableRecording:
    """The recording of a file of samples.

    Parameters
    ----------
    columns : of the output x, y, z, as far as ``axes`` go; by default x, y, z or out_x, out_y, out_z
    time : column of the time in s, ``time_s`` by default; rate_hz : instead of a column
    unit : of the outputs; empty: not known

    Raises
    ------
    DataRejected
        A column is missing, a value is not finite, or the time does not always increase.
    WrongUse
        The file states another unit for the time or an output.
    """
    content, _ = files.read_content(path)
    table = content.table
    names = list(map(str, table.columns))
    columns, time = [column_name(names, name) or name for name in columns], column_name(names, time) or time
    states = {name: output_unit(content.units.get(name, "")) for name in columns if unit}
    states |= {time: unit_stated(content.units.get(time, ""))} if time else {}
    for name, found in states.items():
        if found not in {"", needed := "s" if name == time else unit}:
            raise WrongUse(
                f"{path.name}: column '{shown(name)}' states {found}, {needed} is needed; convert the column"
            )
    return recording_of(table, path.name, columns, time=time, rate_hz=rate_hz, axes=axes)


def recording_of(
    table: pd.DataFrame,
    where: str,
    columns: Sequence[str] = (),
    *,
    time: str = "",
    rate_hz: float | None = None,
    axes: Sequence[int] = ALL_AXES,
    least: int = 2,
) -> CorrectableRecording:
    """The recording of a table of ``least`` samples or more, as :func:`read_recording`; ``where``: its name, for messages."""
    there, clock = list(table.columns), time or TIME
    if clock in there and is_moment(table[clock]):
        table = table.assign(**{clock: seconds(table[clock], where)})
    letters = [AXES[axis] for axis in axes]
    usual = ([names[axis] for axis in axes] for names in USUAL)
    chosen = list(columns) or next((names for names in usual if set(names) <= set(there)), [])
    if len(chosen) != len(letters):
        needed = f"{number_of(len(letters), 'column')} of output ({', '.join(letters)})"
        raise WrongUse(
            f"{where}: columns {', '.join(shown(name) for name in there[:8])}, {needed} needed; name them with --map "
            f"{','.join(f'{letter}=…' for letter in letters)}"
        )
    output = np.stack([finite_column(table, name, where) for name in chosen], axis=1)
    n = len(output)
    if rate_hz is not None and time:
        raise WrongUse(f"{where}: --map time=… and --rate are both given, one is needed; leave one out")
    moments = np.arange(n) / rate_hz if rate_hz is not None else finite_column(table, clock, where)
    if n < least or not np.all(np.diff(moments) > 0.0):
        raise DataRejected(
            f"{where}: {n} samples whose time does not always increase, {least} or more in order are needed; sort the "
            "file, or cut it where its clock restarts"
        )
    known = np.full((n, 3), np.nan)
    if set(FORCE_COLUMNS) <= set(there):
        known = np.stack([as_numbers(table[name], where) for name in FORCE_COLUMNS], axis=1)
    state = replace(_state(table, moments, {*chosen, clock}, where), axes=tuple(axes))
    return CorrectableRecording(moments, output, state, known, where)


def at_calibrated_supply(recording: CorrectableRecording, run: Run) -> CorrectableRecording:
    """The recording with the outputs at the nominal supply, where the calibration has them so; its supply is needed then."""
    terms = archived_terms(run.about)
    if terms is None or terms.follows is None:
        return recording
    follows = terms.follows
    supply = recording.state.supply
    if supply is None or not np.all(supply > 0.0):
        raise DataRejected(
            f"{recording.name}: the output follows the supply and was calibrated at {follows.nominal_V:g} V, the measured "
            "supply is needed; add a column supply_V in V"
        )
    return replace(recording, output=recording.output / follows.ratio(supply)[:, None])


def without_force(recording: CorrectableRecording) -> CorrectableRecording:
    """The recording without what its file states of the true force."""
    return replace(recording, known=np.full_like(recording.known, np.nan))


def _state(table: pd.DataFrame, time: Array, used: set[str], where: str) -> State:
    """Conditions by the names of recorded quantities; any other column of numbers is a covariate."""
    known: dict[str, Any] = {}
    covariates: dict[str, Array] = {}
    for column in table.columns:
        if column in used or column in FORCE_COLUMNS:
            continue
        row = BY_COLUMN.get(column)
        if row is not None and row.attribute and not row.once:
            known[row.attribute] = row.factor * finite_column(table, column, where)
        elif (row is None or not row.attribute) and pd.api.types.is_numeric_dtype(table[column]):
            covariates[column] = as_numbers(table[column], where, flags=True)
    known["time"] = time
    return State(force=np.zeros((len(time), 3)), **known, covariates=covariates)
