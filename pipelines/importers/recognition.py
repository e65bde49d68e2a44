"""What a file of another system holds: columns, units, clock, stops, and how it is imported, for commands and pages."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from inertial import change_of_level
from inertial.arrays import Array
from pipelines.importers import (
    clocks,
    files,
    guesses,
    named_columns,
    sample_faults,
    sources,
    stretches,
    unit_check,
    values,
)
from pipelines.importers.content import Content
from pipelines.importers.exchange import is_exchange
from pipelines.importers.guesses import Guesses, measurable
from pipelines.importers.mapping import TIME_UNITS
from pipelines.importers.proposal import ASSUMED_HZ, Proposal, columns_and_units, for_fit, of_stops
from pipelines.importers.record_time import gap_limit


@dataclass(frozen=True)
class Recognition:
    """A recording as it is recognised.

    source : the files · time, output : (n,) s and (n, 3) of the rows with all numbers; None where there are none
    labels : of these rows, where a column marks the dwells · joints : numbers of these rows before which another file begins
    gaps : in time · stops : None where no record was searched · faults : of the samples · open : what the file does not state
    keys : of the mapping, with words in capitals for what is open · is_exchange : a table of dwells, read as it is
    """

    paths: tuple[Path, ...]
    content: Content
    source: files.SourceFile
    guessed: Guesses
    is_exchange: bool = False
    time: Array | None = None
    output: Array | None = None
    gaps: int = 0
    rate_hz: float | None = None
    stops: stretches.Stops | None = None
    faults: sample_faults.SampleFaults | None = None
    open: tuple[str, ...] = ()
    keys: dict[str, Any] | None = None
    labels: tuple[str, ...] | None = None
    joints: tuple[int, ...] = ()

    @property
    def import_command(self) -> str:
        """The command that imports it, for a shell."""
        return "" if self.keys is None else Proposal(self.keys).command(self.paths)

    def for_fit(self) -> Proposal | None:
        """The import with a fit, where nothing has to be added but what may be assumed; None otherwise."""
        if self.keys is not None and self.guessed.single and not self.open:  # one axis with its reference
            return Proposal(self.keys)
        if self.keys is None or self.output is None or any(text != _NO_CLOCK for text in self.open):
            return None
        if self.guessed.dwells:
            named = self.guessed.column("dwell")
            labelled = bool(named) and len(self.content.table) == len(self.output)
            numbered = [f"dwell {k}" for k in range(len(self.output))]
            labels = self.content.table[named].astype(str).tolist() if labelled else numbered
            return self._proposal(self.keys, self.output, labels)
        time = np.arange(len(self.output)) / ASSUMED_HZ if self.time is None else self.time
        stops = self.stops or _stops(self.output, time, self.guessed.output.meaning, self.joints)
        if self.labels is not None and stops is not None:
            found, every = stretches.labelled(self.labels, _edges(time, self.joints), stops.found)
            proposal = self._of_stretches(self.keys, found, time)
            if every or proposal.fit == "faces":  # named faces leave the other labels out
                return proposal
        keys: dict[str, Any] = {**self.keys, "columns": {**self.keys["columns"]}}
        keys["columns"].pop("dwell", None)  # positions without a name are those that the search finds
        keys = keys if self.stops and self.labels is None else _with_stops(keys, self.output, stops)
        found = stretches.by_positions(self.output, keys["positions"], "") if "positions" in keys else None
        found = stops.found if found is None and stops is not None else found
        proposal = self._of_stretches(keys, found, time)
        handled = _handling(stops, time) if stops is not None and proposal.fit else ""
        return replace(proposal, remarks=(*proposal.remarks, handled)) if handled else proposal

    def _of_stretches(self, keys: dict[str, Any], found: stretches.Stretches | None, time: Array) -> Proposal:
        """The import with a fit of a record's static stretches."""
        duration = float(time[-1] - time[0])
        if found is None or not len(found) or self.output is None:
            return self._proposal(keys, None, [], duration)
        means = np.stack([self.output[first:last].mean(axis=0) for first, last in found.spans])
        return self._proposal(keys, means, found.labels, duration)

    def _proposal(
        self, keys: dict[str, Any], means: Array | None, labels: Sequence[str], duration: float | None = None
    ) -> Proposal:
        warm = self.guessed.column("temperature")
        heat = measurable(values.as_numbers(self.content.table[warm], warm)) if warm else None
        return for_fit(keys, self.guessed, means, labels, duration, heat)


_NO_CLOCK = "the rate of the samples: no column of time was recognised and the file states no interval; --rate HZ"


def recognise(paths: Sequence[Path], *, join: str = "", group: str = "") -> Recognition:
    """The recording of one or several files, which are joined as :func:`pipelines.importers.sources.read` does."""
    first, source = files.read_content(paths[0], group)
    content, breaks = first, ()
    if len(paths) > 1:
        time_name = guesses.guesses(first).column("time")
        content, source, breaks = sources.read(paths, join=join, time=time_name, group=group)
    stated = ({"join": join} if join else {}, {"group": group} if group else {})
    return of_content(content, source, paths, *stated, breaks=breaks)


def of_content(
    content: Content,
    source: files.SourceFile,
    paths: Sequence[Path],
    *stated: dict[str, Any],
    breaks: Sequence[int] = (),
) -> Recognition:
    """The recording of a file that was read.

    Parameters
    ----------
    stated : keys of the mapping that the user gave
    breaks : rows before which another file begins
    """
    if len(paths) == 1 and is_exchange(content.table.columns):
        guessed = guesses.guesses_of_dwells(content.table)
        return Recognition(tuple(paths), content, source, guessed, is_exchange=True)
    serial = named_columns.serials(content.table)
    by_unit = content
    if serial:  # a clock and numbers of dwells are those of one unit, however the rows are mixed, and so is a stop
        number = content.table.groupby(serial, sort=False).ngroup()
        by_unit = replace(content, table=content.table.loc[number.sort_values(kind="stable").index])
        breaks = [*breaks, *(np.flatnonzero(np.diff(number)) + 1).tolist()]
    guessed = guesses.guesses(by_unit)
    content = by_unit if guessed.dwells else content
    time, open_ = _time(content, guessed)
    output = _output(content, guessed)
    finite = np.ones(len(content.table), dtype=bool) if output is None else np.isfinite(output).all(axis=1)
    if time is not None:
        finite &= np.isfinite(time)
    samples = None if output is None else output[finite]
    clock = None if time is None else time[finite]
    steps = np.diff(clock) if clock is not None else np.zeros(0)
    gaps = int(np.count_nonzero(steps > gap_limit(steps)))
    faults = sample_faults.look(samples) if samples is not None and len(samples) > 3 and not guessed.dwells else None
    joints = tuple(np.searchsorted(np.flatnonzero(finite), breaks).tolist())
    stops = (
        _stops(samples, clock, guessed.output.meaning, joints)
        if samples is not None and clock is not None and not guessed.dwells
        else None
    )
    named = guessed.column("dwell")
    labels = None
    if named and samples is not None and not guessed.dwells:
        labels = tuple(np.asarray(content.table[named].astype(str), dtype=np.str_)[finite].tolist())
    keys = columns_and_units(content, guessed, paths[0])
    if stops is not None and samples is not None and labels is None:  # what marks the dwells is not searched for
        keys = _with_stops(keys, samples, stops)
    for more in stated:
        keys |= more
    keys |= {"gaps": "split"} if gaps or not bool(finite.all()) else {}
    keys |= {"faulty": "leave-out"} if faults else {}
    open_ += _open(guessed, samples)
    serials = content.table.get(guessed.column("unit"), pd.Series()).dropna().unique()
    if len(serials) > 1 and not guessed.dwells:
        open_ = [
            f"samples of {len(serials)} units, one is needed: divide the file by its column '{guessed.column('unit')}'"
        ]
    return Recognition(
        tuple(paths), content, source, guessed, False, clock, samples, gaps, _rate(clock), stops, faults, tuple(open_), keys,
        labels, joints,
    )  # fmt: skip


_OUTPUT_UNIT = "the unit of the output: --unit-of output=g|mg|m/s^2|V|mV|LSB"


def _open(guessed: Guesses, output: Array | None) -> list[str]:
    """The facts on its outputs that the file leaves open, a sentence each."""
    open_ = [guessed.triad.doubt] if guessed.triad.doubt else []
    if output is None:
        if guessed.single and not guessed.output.meaning:
            open_.append(_OUTPUT_UNIT)
        if guessed.single or open_:
            return open_
        if guessed.few:
            found = " and ".join(f"{axis}: {column}" for axis, column in guessed.few.items())
            open_.append(
                f"{found} taken for a device of fewer than three axes, which an import takes by --set axes=…; 'tumbleline fit "
                "RUN' fits it where its angle or force is beside it (--map tilt=… or force_x=…), and a record at rest has its "
                "noise by 'tumbleline noise allan' and 'tumbleline noise psd'"
            )
            return open_ if guessed.output.meaning else [*open_, _OUTPUT_UNIT]
        missing = [axis for axis in "xyz" if not guessed.column(axis)]
        open_.append(f"columns of acceleration were not recognised: map {' and '.join(missing)} by name or number")
        return open_
    bits = unit_check.unsigned_bits(output)
    if bits:
        open_.append(
            f"signed words of {bits} bits were read without their sign: subtract {2**bits} from {2 ** (bits - 1)} on"
        )
    if not guessed.output.meaning:
        open_.append(_OUTPUT_UNIT)
    elif guessed.output.reason.endswith(unit_check.DOUBT):
        open_.append(f"the unit of the output; {guessed.output.meaning} is a guess, {guessed.output.reason}")
    return open_


def _time(content: Content, guessed: Guesses) -> tuple[Array | None, list[str]]:
    """Seconds of every row, and missing options."""
    name = guessed.column("time")
    if not name and content.interval_s is not None and not guessed.dwells:
        return content.interval_s * np.arange(len(content.table), dtype=np.float64), []
    if not name:
        return None, [] if guessed.dwells else [_NO_CLOCK]
    column = content.table[name]
    open_: list[str] = []
    if values.is_moment(column):
        time = values.seconds(column.ffill(), name)
    elif clocks.is_stamps(column):
        time = clocks.stamps(column.ffill().bfill(), name).seconds
    else:
        numbers = measurable(np.asarray(values.as_numbers(column, name), dtype=np.float64))
        unit = guessed.time_unit.meaning
        if not unit:
            open_.append(
                f"the unit of time: {guessed.time_unit.reason}; --unit-of time=s|ms|us|ns, or time=samples and --rate HZ"
            )
        first = numbers[np.isfinite(numbers)][0] if np.any(np.isfinite(numbers)) else 0.0
        time = (numbers - first) * (1.0 / guesses.FINE_HZ if unit == "samples" else TIME_UNITS.get(unit, 1.0))
    # in a table of dwells each unit may have a clock of its own
    unit = content.table.get(guessed.column("unit") if guessed.dwells else None, 0)
    rows = pd.DataFrame({"time": time, "unit": unit}).dropna(subset="time")
    back = rows.index[rows.groupby("unit", dropna=False)["time"].diff() < 0.0]
    if len(back) and not guessed.column("dwell"):
        open_.append(f"time runs back at row {int(back[0]) + 1}: sort the rows, or divide the file")
    return time, open_


def _rate(time: Array | None) -> float | None:
    """Samples in a second; of a clock with bursts by the whole record."""
    if time is None or len(time) < 2:
        return None
    step, mean = clocks.typical_step(time), float(time[-1] - time[0]) / (len(time) - 1)
    if not step > 0.0:
        return None
    bursts = gap_limit(np.diff(time)) > _OF_BURSTS * step
    return 1.0 / (mean if bursts and mean > 0.0 else step)


_OF_BURSTS = 8.0
"""Multiple of the usual step in a gap from which the usual step is that inside bursts."""


def _output(content: Content, guessed: Guesses) -> Array | None:
    names = [guessed.column(axis) for axis in "xyz"]
    if not all(names):
        return None
    return np.column_stack([measurable(values.as_numbers(content.table[name], name)) for name in names])


def _stops(output: Array, time: Array, unit: str, joints: Sequence[int] = ()) -> stretches.Stops | None:
    """The stops of a record; None of a few samples, or of a clock that does not advance."""
    steps = np.diff(time)
    if len(output) < 3 or np.any(steps < 0.0) or not np.any(steps > 0.0):
        return None
    return stretches.found_stops(output, time, _edges(time, joints), unit_check.GRAVITY.get(unit))


def _edges(time: Array, joints: Sequence[int] = ()) -> list[int]:
    """The samples before which time has a gap or another file begins, with the first sample and the index past the last."""
    steps = np.diff(time)
    return sorted({0, *(np.flatnonzero(steps > gap_limit(steps)) + 1).tolist(), *joints, len(time)})


def _handling(stops: stretches.Stops, time: Array) -> str:
    """A sentence on the motion before the first stop and after the last, longer than a window; empty where there is none."""
    if not len(stops.found):
        return ""
    first, last = (float(time[k] - time[0]) for k in (stops.found.spans[0][0], stops.found.spans[-1][1] - 1))
    ends = first > stops.window_s, float(time[-1] - time[0]) - last > stops.window_s
    return stretches.handling_left_out(stops.found, time, ends)


def _with_stops(keys: dict[str, Any], output: Array, stops: stretches.Stops | None) -> dict[str, Any]:
    if stops is None:
        return keys
    return of_stops(keys, stops, change_of_level.several_levels(output) if stops.several else 1)
