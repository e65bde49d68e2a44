"""Foreign columns turned into a raw record and its dwells; what does not agree with what was claimed is refused."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from inertial import static_intervals
from pipelines.importers import exchange, values
from pipelines.importers.mapping import FACES, MEANINGS, OUTPUT_UNITS, TIME_UNITS, Mapping
from schemas.errors import DataRejected, WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.serials import refuse_unusable_serials
from schemas.units import AXES, STANDARD_GRAVITY_M_S2

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_LIKELY = (0.5, 2.0)
"""Median norm over gravity of a record in the unit claimed: bias and hand shaking stay well inside."""
_SURE = 0.05


@dataclass(frozen=True)
class Imported:
    """One file's record and dwells, in the tables of the archive."""

    samples: pd.DataFrame | None
    """Raw record; None where the file's rows are dwells already."""
    dwells: pd.DataFrame | None
    """Exchange format; None where nothing stands still."""
    out_unit: str
    remarks: tuple[str, ...]

    @property
    def units(self) -> list[str]:
        """Serial numbers."""
        table = self.samples if self.dwells is None else self.dwells
        return [] if table is None else sorted(set(table["unit"].tolist()))


def imported(table: pd.DataFrame, mapping: Mapping, where: str) -> Imported:
    """The record and dwells of a foreign table.

    Raises
    ------
    DataRejected
        A column is not there, a value is no finite number, time runs back, the norm contradicts the unit.
    """
    columns = _columns(table, mapping, where)
    output = _output(columns, mapping, where)
    out_unit = OUTPUT_UNITS[mapping.units.output][0]
    _refuse_other_unit(output, out_unit, where)
    serials = _serials(columns, mapping, where)
    extras = _extras(columns, mapping, where)
    if mapping.rows == "dwells":
        return _as_dwells(columns, output, serials, extras, mapping, where)
    time, remarks = _time(columns, mapping, where)
    if len(set(serials)) > 1:
        raise DataRejected(
            f"{where}: samples of {len(set(serials))} units in one file, one unit is needed; divide the file"
        )
    samples = pd.DataFrame({"unit": serials, "slot": 0, "record": 0, "kind": "dwell", "time_s": time})
    samples[list(AXES)] = output
    samples = samples.assign(**extras)
    first, last, labels = _stretches(columns, output, time, mapping)
    first, last, labels = _wanted(first, last, labels, mapping, where)
    dwells = _means(samples, first, last, labels, tuple(extras), mapping) if first else None
    record = np.zeros(len(samples), dtype=np.int64)
    for number, (a, b) in enumerate(zip(first, last, strict=True)):
        record[a:b] = number + 1
    samples["record"] = record
    return Imported(samples, dwells, out_unit, remarks)


def _columns(table: pd.DataFrame, mapping: Mapping, where: str) -> dict[str, pd.Series]:
    names = [str(name) for name in table.columns]
    named = table.set_axis(names, axis=1)
    for meaning, column in mapping.columns.items():
        if column not in names:
            raise DataRejected(
                f"{where}: column '{shown(column)}' (for {meaning}) is not there; {did_you_mean(column, names)}"
            )
    return {meaning: pd.Series(named[column], name=column) for meaning, column in mapping.columns.items()}


def _finite(column: pd.Series, where: str, *, flags: bool = False) -> NDArray[np.float64]:
    numbers = values.as_numbers(column, where, flags=flags)
    bad = np.flatnonzero(~np.isfinite(numbers))
    if bad.size:
        row = int(bad[0])
        raise DataRejected(
            f"{where}: row {row + 1}, column '{shown(str(column.name))}': found {shown(str(column.iloc[row]))}, a finite number "
            f"is needed ({bad.size} such rows); repair the file or leave those rows out"
        )
    values.refuse_outside(numbers, "", where, label=str(column.name))
    return numbers


def _output(columns: dict[str, pd.Series], mapping: Mapping, where: str) -> NDArray[np.float64]:
    """Output (n, 3) after axes, signs and unit."""
    factor = OUTPUT_UNITS[mapping.units.output][1]
    signs = [factor if sign == "+" else -factor for sign in mapping.signs]
    return np.column_stack(
        [_finite(columns[axis], where) * sign for axis, sign in zip(mapping.axes, signs, strict=True)]
    )


def _refuse_other_unit(output: NDArray[np.float64], out_unit: str, where: str) -> None:
    size = float(np.median(np.linalg.norm(output, axis=1)))
    gravity = {"g": 1.0, "m/s^2": STANDARD_GRAVITY_M_S2}
    if out_unit in gravity:
        if _LIKELY[0] < size / gravity[out_unit] < _LIKELY[1]:
            return
        other = next(
            (u for u, one in (*gravity.items(), ("mg", 1e3)) if _LIKELY[0] < size / one < _LIKELY[1]), "LSB or V"
        )
        raise DataRejected(
            f"{where}: the norm of the output is {size:.5g}, about {gravity[out_unit]:.5g} is needed if its unit is "
            f"{out_unit}; the unit looks like {other}, say so with --units output={other.split()[0]}"
        )
    whole = bool(np.all(output[:1000] == np.rint(output[:1000])))
    close = [unit for unit, one in gravity.items() if abs(size / one - 1.0) < _SURE]
    if out_unit == "LSB" and close and not whole:
        raise DataRejected(
            f"{where}: the norm of the output is {size:.5g} and its values are no whole numbers, counts are needed if its "
            f"unit is LSB; the unit looks like {close[0]}, say so with --units output={close[0]}"
        )


def _serials(columns: dict[str, pd.Series], mapping: Mapping, where: str) -> list[str]:
    if "unit" in columns:
        serials = ["" if pd.isna(value) else values.text(value) for value in columns["unit"].tolist()]
        refuse_unusable_serials(
            dict.fromkeys(serials), f"{where}: column '{columns['unit'].name}'", "correct it in the file"
        )
        return serials
    if not mapping.unit:
        raise WrongUse(f"{where}: whose record is it? no unit is mapped, a serial number is needed; give --unit SN")
    refuse_unusable_serials([mapping.unit], where)
    return [mapping.unit] * len(columns["x"])


def _clock(columns: dict[str, pd.Series], mapping: Mapping, where: str) -> NDArray[np.float64]:
    """Seconds from any beginning."""
    if "time" in columns and values.is_moment(columns["time"]):
        return values.seconds(columns["time"], where)
    if "time" not in columns or mapping.units.time == "samples":
        if mapping.rate_hz is None:
            raise WrongUse(
                f"{where}: no time in seconds is mapped, a rate is needed then; map time=…, or give --rate HZ"
            )
        count = _finite(columns["time"], where) if "time" in columns else np.arange(len(columns["x"]), dtype=np.float64)
        time = count / mapping.rate_hz
    else:
        time = _finite(columns["time"], where) * TIME_UNITS[mapping.units.time]
    values.refuse_outside(time, "time_s", where)
    return time


def _refuse_backwards(time: NDArray[np.float64], group: Sequence[Any], where: str, *, together: bool) -> None:
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


def _time(columns: dict[str, pd.Series], mapping: Mapping, where: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Seconds since the first sample of a record."""
    time = _clock(columns, mapping, where)
    if "dwell" in columns:  # dwells may have been recorded one by one, each with a clock of its own
        _refuse_backwards(time, columns["dwell"].astype(str).tolist(), where, together=False)
        return time - time[0], ()
    _refuse_backwards(time, [""] * len(time), where, together=False)
    if len(time) < 2 or time[-1] <= time[0]:
        found = "1 sample" if len(time) < 2 else f"{len(time)} samples, all at {time[0]:g} s"
        raise DataRejected(
            f"{where}: {found}, a record of two at least that takes some time is needed; map another column as time, give "
            "--rate HZ without one, or say --rows dwells"
        )
    gaps = np.diff(time)
    typical = float(np.median(gaps))
    wide = int(np.sum(gaps > 5.0 * typical)) if typical > 0.0 else 0
    return time - time[0], (f"{wide} gaps in time, longer than five samples",) if wide else ()


def _extras(columns: dict[str, pd.Series], mapping: Mapping, where: str) -> dict[str, NDArray[np.float64]]:
    """Temperature, other known columns and covariates by the names of the tables."""
    extras: dict[str, NDArray[np.float64]] = {}
    for meaning, column in columns.items():
        if meaning in ("time", *AXES, "unit", "dwell"):
            continue
        name = MEANINGS.get(meaning, meaning)
        numbers = _finite(column, where, flags=meaning not in MEANINGS)
        if meaning in ("temperature", "chamber"):
            numbers = _celsius(numbers, mapping.units.temperature)
        values.refuse_outside(numbers, name, where)
        extras[name] = numbers
    return extras


def _celsius(values: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    if unit == "K":
        return values - 273.15
    return (values - 32.0) / 1.8 if unit == "degF" else values


def _stretches(
    columns: dict[str, pd.Series], output: NDArray[np.float64], time: NDArray[np.float64], mapping: Mapping
) -> tuple[list[int], list[int], list[str]]:
    """First, one past the last sample, and label of each stretch at rest."""
    if "dwell" in columns:
        labels = columns["dwell"].astype(str).to_numpy(dtype=object)
        first = np.concatenate([[0], np.flatnonzero(labels[1:] != labels[:-1]) + 1])
        last = np.concatenate([first[1:], [labels.size]])
        return first.tolist(), last.tolist(), [str(labels[k]) for k in first]
    if mapping.block_s is not None:
        number = np.floor((time - time[0]) / mapping.block_s).astype(np.int64)
        first = np.concatenate([[0], np.flatnonzero(np.diff(number)) + 1])
        last = np.concatenate([first[1:], [time.size]])
        return first.tolist(), last.tolist(), [f"block {k}" for k in range(first.size)]
    rate = mapping.rate_hz or (len(time) - 1) / float(time[-1])
    if len(time) < 3 * max(3, round(rate)):
        return [], [], []
    found = static_intervals.find(output, rate)
    return found.start.tolist(), found.stop.tolist(), [f"dwell {k}" for k in range(len(found))]


def _wanted(
    first: list[int], last: list[int], labels: list[str], mapping: Mapping, where: str
) -> tuple[list[int], list[int], list[str]]:
    """The stretches that the poses name; all where no pose is named."""
    if not mapping.poses:
        return first, last, labels
    missing = [label for label in mapping.poses if label not in labels]
    if missing:
        raise DataRejected(
            f"{where}: no dwell is labelled '{missing[0]}' (in --poses); {did_you_mean(missing[0], labels)}"
        )
    kept = [k for k, label in enumerate(labels) if label in mapping.poses]
    return [first[k] for k in kept], [last[k] for k in kept], [labels[k] for k in kept]


def _means(
    samples: pd.DataFrame,
    first: list[int],
    last: list[int],
    labels: list[str],
    extras: tuple[str, ...],
    mapping: Mapping,
) -> pd.DataFrame:
    """Dwells in the exchange format."""
    values = samples[[*AXES, *extras]].to_numpy(dtype=np.float64)
    time = samples["time_s"].to_numpy(dtype=np.float64)
    slices = [slice(a, b) for a, b in zip(first, last, strict=True)]
    mean = np.stack([values[s].mean(axis=0) for s in slices])
    sd = np.stack([values[s, :3].std(axis=0, ddof=1) if s.stop - s.start > 1 else np.zeros(3) for s in slices])
    frame = pd.DataFrame(
        {
            "unit": samples["unit"].iloc[0],
            "dwell": np.arange(len(slices)),
            "time_s": [float(time[s].mean()) for s in slices],
            **{f"out_{axis}": mean[:, k] for k, axis in enumerate(AXES)},
            **{f"sd_{axis}": sd[:, k] for k, axis in enumerate(AXES)},
            "n": [s.stop - s.start for s in slices],
            "duration_s": [float(time[s.stop - 1] - time[s.start]) for s in slices],
            **{name: mean[:, 3 + k] for k, name in enumerate(extras)},
            "record": np.arange(len(slices)) + 1,
            "pose": labels,
        }
    )
    return _finished(frame, mapping)


def _as_dwells(
    columns: dict[str, pd.Series],
    output: NDArray[np.float64],
    serials: list[str],
    extras: dict[str, NDArray[np.float64]],
    mapping: Mapping,
    where: str,
) -> Imported:
    """A file whose rows are dwells already."""
    count = pd.Series(serials).groupby(serials).cumcount().to_numpy()
    time = count.astype(np.float64)
    if "time" in columns:
        time = _clock(columns, mapping, where)
        _refuse_backwards(time, serials, where, together=True)  # units may follow one another, or alternate
        time = time - float(time.min())
    frame = pd.DataFrame({"unit": serials, "dwell": count, "time_s": time})
    frame[["out_x", "out_y", "out_z"]] = output
    labels = columns["dwell"].astype(str).tolist() if "dwell" in columns else [f"dwell {k}" for k in count]
    frame = _finished(frame.assign(record=count, pose=labels, **extras), mapping)
    return Imported(None, exchange.checked(frame, where=where, foreign=True), OUTPUT_UNITS[mapping.units.output][0], ())


def _finished(frame: pd.DataFrame, mapping: Mapping) -> pd.DataFrame:
    """The columns that every dwell has, and the reference where poses are named."""
    frame = frame.assign(slot=0, kind="dwell", soak=0, out_unit=OUTPUT_UNITS[mapping.units.output][0])
    if not (mapping.poses or mapping.face):
        return frame
    if mapping.norm_g is None:
        raise WrongUse("import: poses are named, but not how strong gravity is, which is needed; give --local-g M/S2")
    up = [mapping.poses.get(label, mapping.face) for label in frame["pose"]]
    frame[["force_x", "force_y", "force_z"]] = np.array([FACES[face] for face in up]) * mapping.norm_g
    return frame
