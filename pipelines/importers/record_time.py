"""The time of a foreign record in seconds: any clock, no step back, no unknown gap."""

from collections.abc import Mapping as Columns
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.counts import number_of
from pipelines.importers import clocks, values
from pipelines.importers.clocks import RecordingClock
from pipelines.importers.content import Content
from pipelines.importers.local_time import CHECK_HOUR, local_seconds
from pipelines.importers.mapping import TIME_UNITS, Mapping
from pipelines.importers.stretches import Stretches
from schemas.errors import DataRejected, WrongUse
from schemas.foreign import shown

FASTEST_K_S = 5.0
"""Rate of temperature that no chamber reaches."""
LONGEST_MOVE_S = 300.0
"""Between two positions, of a hand or a table."""
SHORTEST_RECORD_S = 3.0
GAP = 5.0
"""Multiple of the usual step above which a step is a gap."""
BURST, OFTEN = 3.0, 0.01
"""Multiple of the usual step from which the longest steps, of this share, are those between bursts; and of these for a gap."""


def seconds(
    columns: Columns[str, pd.Series], mapping: Mapping, content: Content, where: str, *, dwells: bool = False
) -> RecordingClock:
    """Seconds of every row from any beginning.

    Parameters
    ----------
    content : of the file, which knows the units of its columns and the lines of its rows.
    dwells : whether rows are dwells, whose steps say nothing about their unit.

    Raises
    ------
    DataRejected
        Time runs back, or does not advance.
    WrongUse
        There is no time and no rate, or the unit of time cannot be recognised.
    """
    clock = _clock(columns, mapping, content, where, dwells=dwells)
    values.refuse_outside(clock.seconds, "time_s", where)
    if dwells:
        return clock
    time = clock.seconds
    if "dwell" in columns:  # dwells may have been recorded separately, each with its clock
        labels = columns["dwell"].astype(str).tolist()
        backwards(time, labels, where, together=False)
        return _continued(clock)
    backwards(time, [""] * len(time), where, together=False)
    if len(time) < 2 or time[-1] <= time[0]:
        found = "1 sample" if len(time) < 2 else f"{len(time)} samples, all at {columns['time'].iloc[0]:g} s"
        raise DataRejected(
            f"{where}: {found}, a record of two at least that takes some time is needed; map another column as time, give "
            "--rate HZ without one, or say --set rows=dwells"
        )
    return clock


def _continued(clock: RecordingClock) -> RecordingClock:
    """A clock without steps back: where it restarts, it goes on one usual step after the sample before."""
    steps = np.diff(clock.seconds)
    back = steps < 0.0
    if not back.any():
        return clock
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    time = clock.seconds[0] + np.concatenate([[0.0], np.cumsum(np.where(back, usual, steps))])
    remark = f"the clock restarts {int(back.sum())} times between dwells; it is continued, so the time between them is unknown"
    return RecordingClock(time, clock.unit, (*clock.remarks, remark))


def _clock(
    columns: Columns[str, pd.Series], mapping: Mapping, content: Content, where: str, *, dwells: bool
) -> RecordingClock:
    time = columns.get("time")
    if time is not None and values.is_moment(time):
        local = time.dtype.kind == "M" and not isinstance(time.dtype, pd.DatetimeTZDtype)
        read, remarks = local_seconds(time, mapping.zone, where) if local else (values.seconds(time, where), ())
        return RecordingClock(read, "s", remarks)
    if time is not None and clocks.is_stamps(time) and mapping.units.time != "samples":
        return clocks.stamps(time, where, mapping.zone)
    if mapping.zone:
        raise WrongUse(
            f"{where}: zone={mapping.zone} is for stamps of date and time, none are mapped as time; leave it out"
        )
    if time is None or mapping.units.time == "samples":
        if mapping.rate_hz is None:
            raise WrongUse(
                f"{where}: no time in seconds is mapped, a rate is needed then; map time=…, or give --rate HZ"
            )
        rows = np.arange(len(columns["x"]), dtype=np.float64)
        count = rows if time is None else values.finite(time, where, content, needed="a time")
        return RecordingClock(count / mapping.rate_hz, "samples", ())
    numbers = values.finite(time, where, content, needed="a time")
    name = str(time.name)
    stated = content.units.get(name, "")
    if dwells:
        recognition = clocks.recognised(numbers, name, stated)
        known = recognition.unit if not recognition.reason.startswith("steps") else ""
        unit = mapping.units.time or known or "s"
        return RecordingClock(numbers * TIME_UNITS[unit], unit, ())
    if np.all(numbers == numbers[0]):
        return RecordingClock(np.zeros(len(numbers)), "s", ())
    return clocks.clock(numbers, name, mapping.units.time, stated, where)


def backwards(time: Array, group: Sequence[Any], where: str, *, together: bool) -> None:
    """Refuse times that run back within a group.

    Parameters
    ----------
    group : a label for each row.
    together : whether rows of a group that others lie between belong together, as those of one unit do.
    """
    codes = pd.factorize(np.asarray(group, dtype=object))[0]
    order = np.argsort(codes, kind="stable") if together else np.arange(len(time))
    back = np.flatnonzero((np.diff(time[order]) < 0.0) & (np.diff(codes[order]) == 0))
    if back.size:
        row, before = int(order[back[0] + 1]), int(order[back[0]])
        label = f" within {shown(str(group[row]))}" if len(set(codes.tolist())) > 1 else ""
        raise DataRejected(
            f"{where}: row {row + 1}: time runs back by {time[before] - time[row]:.4g} s{label}, it must not; sort the rows"
        )


def gap_limit(steps: Array) -> float:
    """The step of a clock, s, above which samples are missing.

    A logger that writes in bursts has a long step after each; steps that one in a hundred has are those of its clock.
    """
    forward = steps[steps > 0.0]
    if not forward.size:
        return 0.0
    usual = float(np.median(forward))
    often = float(np.quantile(forward, 1.0 - OFTEN))
    return max(GAP * usual, BURST * often) if often > BURST * usual else GAP * usual


def gaps_of(
    clock: RecordingClock, labels: pd.Series | None, breaks: Sequence[int], mapping: Mapping, where: str
) -> tuple[list[int], tuple[str, ...]]:
    """Rows before which samples are missing, with the breaks that were known before; a remark on them.

    Raises
    ------
    DataRejected
        There are unknown gaps, and the mapping does not allow them.
    """
    steps = np.diff(clock.seconds)
    wide = np.flatnonzero(steps > gap_limit(steps)) + 1
    if labels is not None:  # between two labels nothing needs to be recorded
        names = labels.astype(str).to_numpy(dtype=object)
        wide = wide[names[wide] == names[wide - 1]]
    wide = np.array([k for k in wide.tolist() if k not in set(breaks)], dtype=np.int64)
    if not wide.size:
        return list(breaks), ()
    first, longest = int(wide[0]), float(np.max(steps[wide - 1]))
    gaps = number_of(wide.size, "gap")
    found = f"{gaps} in time longer than {GAP:g} samples, the first before row {first + 1}, the longest {longest:.4g} s"
    if mapping.gaps == "refuse":
        for remark in (remark for remark in clock.remarks if remark.startswith(CHECK_HOUR)):
            raise DataRejected(f"{where}: {remark}")
        raise DataRejected(
            f"{where}: {found}; samples without gaps are needed; record again, or add --set gaps=split to use what lies between"
        )
    return sorted({*breaks, *wide.tolist()}), (f"{found}; dwells end there",)


def time_doubts(
    time: Array, heat: Array | None, intervals: Stretches, mapping: Mapping, *, searched: bool
) -> tuple[str, ...]:
    """Remarks if a record in seconds is impossible for a hand, table or chamber: its time may be in another unit.

    Parameters
    ----------
    heat : (n,), °C; None where none was recorded.
    searched : whether the stretches were found in the record itself.
    """
    span = float(time[-1])
    doubts: list[str] = []
    if heat is not None and span > 0.0 and float(np.ptp(heat)) > FASTEST_K_S * span:
        doubts.append(f"temperature changes by {float(np.ptp(heat)):.3g} K in {span:.3g} s")
    if searched and mapping.positions is None and mapping.block_s is None:
        moves = [float(time[begin] - time[end - 1]) for (_, end), (begin, _) in pairwise(intervals.spans)]
        if len(moves) >= 2 and float(np.median(moves)) > LONGEST_MOVE_S:
            doubts.append(f"the moves between the dwells take {float(np.median(moves)):.4g} s")
        if not len(intervals) and span < SHORTEST_RECORD_S:
            doubts.append(f"the record lasts {span:.3g} s, too short for a dwell")
    return (f"CHECK THE UNIT OF TIME: {'; '.join(doubts)}",) if doubts else ()
