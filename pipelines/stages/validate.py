"""Search for data faults before the fit: a verdict for every unit of the lot.

A unit with a fault is refused completely: it gets a verdict, but no coefficient, grade or certificate; the other units continue.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from inertial.arrays import Array, Flags
from inertial.frames import force_from_angles
from inertial.pointing import _force, contradicts, pointing_error
from pipelines.tables.summaries import HIGHS, LOWS, PROCEDURE, STATIC, means, there
from schemas.lot import Unit
from schemas.units import AXES

FEWEST_TO_JUDGE = 10  # samples: fewer equal values in a row happen by chance where the step is coarse
CHAMBER_MOVED_K = 5.0
FOLLOWED_SHARE = 0.2  # a sensor that follows less than a fifth of the chamber's change does not measure its temperature
FORCE_EXPLAINS = 0.5  # smallest share of an axis' variance over the poses; a working channel has more than 0.99
TURNED_G = 0.5  # smallest range of the force along an axis that is tested: follow-up measurements may have few poses
SAMPLES_KEPT = 0.99


class DataFault(NamedTuple):
    """One fault of the data of one unit."""

    unit: str
    fault: str
    reason: str


def validate(summaries: pd.DataFrame, readings: pd.DataFrame, units: Sequence[Unit]) -> pd.DataFrame:
    """Verdicts: one row per unit of the lot with ``refused``, the first fault, and all reasons.

    Parameters
    ----------
    summaries : summaries of the samples, :func:`pipelines.tables.summaries.summarised`
    readings : readings of the complete run
    units : units of the lot, so that a unit without any reading has a verdict, too
    """
    faults = [*_silent(readings, units), *_reading_faults(readings)]
    readings = readings[readings["kind"] != PROCEDURE]
    answered = readings[readings["status"] == "ok"]
    faults += _sample_faults(answered, summaries)
    faults += _stale_temperatures(answered)
    faults += [
        DataFault(
            unit,
            "frozen_temperature",
            f"the unit's temperature is {value:.6g} °C to the last digit in the last {count} records, a reading that changes "
            "as before and as in the other units is needed; check the temperature sensor",
        )
        for unit, count, value in frozen(answered)
    ]
    output = means(summaries, (STATIC,))
    if len(output):
        faults += _dead_channels(output, answered)
        sound = output[~output["unit"].isin({fault.unit for fault in faults})]
        if reason := contradicts(pointing_of(sound, readings)):  # a pointing error of the table against its encoders
            faults += [DataFault(unit.serial, "table_angles", reason) for unit in units]
    return _verdicts(faults, units)


def _verdicts(faults: list[DataFault], units: Sequence[Unit]) -> pd.DataFrame:
    rows = []
    for unit in units:
        reasons: dict[str, list[str]] = {}
        for fault in faults:
            if fault.unit == unit.serial:
                reasons.setdefault(fault.fault, []).append(fault.reason)
        others = [len(set(texts)) - 1 for texts in reasons.values()]
        more = [f" (and {count} more of this kind)" if count else "" for count in others]
        shown = [texts[0] + text for texts, text in zip(reasons.values(), more, strict=True)]
        rows.append(
            {
                "unit": unit.serial,
                "slot": unit.slot,
                "refused": bool(reasons),
                "fault": next(iter(reasons), ""),
                "reason": "; ".join(shown),
            }
        )
    return pd.DataFrame(rows)


def _silent(readings: pd.DataFrame, units: Sequence[Unit]) -> list[DataFault]:
    """Units that lack a reading of a record."""
    made = set(readings["record"])
    faults = []
    for unit in units:
        missing = made - set(readings.loc[readings["unit"] == unit.serial, "record"])
        if missing:
            reason = f"no reading for {len(missing)} of {len(made)} records, all are needed; check the slot's contacts"
            faults.append(DataFault(unit.serial, "stopped_answering", reason))
    return faults


def _reading_faults(readings: pd.DataFrame) -> list[DataFault]:
    faults = []
    for row in readings[readings["status"] != "ok"].itertuples():
        reason = f"stopped answering at record {row.record} (pose {row.pose}): {row.status}; check the slot's contacts"
        faults.append(DataFault(str(row.unit), "stopped_answering", reason))
    for row in readings[readings["overflow"] & (readings["status"] == "ok")].itertuples():
        reason = (
            f"buffer overflow in record {row.record} (pose {row.pose}): samples are lost; read faster or lower the rate"
        )
        faults.append(DataFault(str(row.unit), "overflow", reason))
    return faults


def _sample_faults(answered: pd.DataFrame, summaries: pd.DataFrame) -> list[DataFault]:
    known = {(row["record"], row["unit"]): row for row in summaries.to_dict("records")}
    faults: list[DataFault] = []
    for record in summaries["record"].unique():
        for row in answered[answered["record"] == record].to_dict("records"):
            summary = known.get((record, row["unit"]))
            fault = _fault_of(summary, str(row["out_unit"]), int(row["n"]), float(row["full_scale"]))
            if fault:
                where = f"in record {row['record']} (pose {row['pose']})"
                faults.append(DataFault(str(row["unit"]), fault[0], f"{fault[1]} {where}; {fault[2]}"))
    return faults


def _fault_of(summary: Mapping[Any, Any] | None, unit: str, n: int, full: float) -> tuple[str, str, str] | None:
    """Fault, finding and remedy of one unit's samples in one record; None if there is none."""
    there = 0 if summary is None else summary["n"]
    if summary is None or there < SAMPLES_KEPT * n or there == 0:
        return "dropped_samples", f"{there} samples of {n}", "measure again"
    if summary["wild_count"]:
        where = f"on {AXES[summary['wild_axis']]} in row {summary['wild_row']} ({summary['wild_count']} such values)"
        return "not_finite", f"{summary['wild_value']} {where}", "measure again"
    still = [k for k in range(len(AXES)) if LOWS[k] in summary and summary[LOWS[k]] == summary[HIGHS[k]]]
    if there >= FEWEST_TO_JUDGE and still:
        finding = f"constant output {summary[LOWS[still[0]]]:g} {unit} on {AXES[still[0]]}"
        return "stuck_output", finding, "check wiring and power of the slot"
    if summary["clipped"]:
        where = f"({full:g} {unit} from zero) on {AXES[summary['clipped_axis']]}"
        return "clipped", f"{summary['clipped']} samples at full scale {where}", "choose a wider range"
    return None


def _stale_temperatures(readings: pd.DataFrame) -> list[DataFault]:
    soaks = readings.groupby(["unit", "soak"])[["chamber_C", "unit_C"]].mean().groupby("unit")
    spans = soaks.max() - soaks.min()
    # for records on a ramp the means of soaks are not conclusive, because a device that lags the chamber has similar means
    records = readings.groupby("unit")[["chamber_C", "unit_C"]]
    crossed = records.quantile(0.95) - records.quantile(0.05)
    stale = spans[
        (spans["chamber_C"] > CHAMBER_MOVED_K)
        & (spans["unit_C"] < FOLLOWED_SHARE * spans["chamber_C"])
        & (crossed["unit_C"] < FOLLOWED_SHARE * crossed["chamber_C"])
    ]
    return [
        DataFault(
            str(unit),
            "stale_temperature",
            f"the unit's temperature moved {device:.2f} K while the chamber moved {chamber:.1f} K, at least "
            f"{FOLLOWED_SHARE * chamber:.1f} K is needed; check the temperature sensor",
        )
        for unit, chamber, device in zip(stale.index, stale["chamber_C"], stale["unit_C"], strict=True)
    ]


def _dead_channels(means: pd.DataFrame, readings: pd.DataFrame) -> list[DataFault]:
    """Axes whose mean output over the poses is not a linear function of the specific force."""
    columns = ["unit", "record", "kind", "outer_deg", "inner_deg", "soak"]
    joined = means.merge(readings.loc[readings["kind"] != "allan", columns], on=["unit", "record"])
    faults = []
    for unit, rows in joined.groupby("unit"):
        if len(rows) < FEWEST_TO_JUDGE // 2:
            continue
        explained = _explained_by_force(rows)
        dead = np.flatnonzero((explained < FORCE_EXPLAINS) & _turned(rows)[: explained.size])
        if dead.size:
            axis = AXES[dead[0]]
            reason = (
                f"dead channel {axis}: the specific force explains {explained[dead[0]]:.0%} of its output over "
                f"{len(rows)} dwells, at least {FORCE_EXPLAINS:.0%} is needed; replace the unit or mend the slot"
            )
            faults.append(DataFault(str(unit), "dead_channel", reason))
    return faults


def _turned(rows: pd.DataFrame) -> Flags:
    """Whether the range of the force along each axis is large enough to expect a response, (3,)."""
    force = force_from_angles(*np.radians(rows[["outer_deg", "inner_deg"]].to_numpy()).T)
    return np.asarray(np.ptp(force, axis=0) >= TURNED_G)


def _explained_by_force(rows: pd.DataFrame) -> Array:
    """Share of each output's variance within the soaks that a linear function of the force explains, (m,)."""
    force = force_from_angles(*np.radians(rows[["outer_deg", "inner_deg"]].to_numpy()).T)
    soaks = (rows["soak"].to_numpy()[:, None] == np.unique(rows["soak"].to_numpy())).astype(float)
    output = np.nan_to_num(rows[there(rows, AXES)].to_numpy(dtype=float), posinf=0.0, neginf=0.0)
    inside = output - soaks @ np.linalg.lstsq(soaks, output, rcond=None)[0]
    design = np.column_stack([force, soaks])
    left = output - design @ np.linalg.lstsq(design, output, rcond=None)[0]
    total = np.sum(inside**2, axis=0)
    return np.where(total > 0.0, 1.0 - np.sum(left**2, axis=0) / np.where(total > 0.0, total, 1.0), 0.0)


def pointing_of(means: pd.DataFrame, readings: pd.DataFrame) -> float:
    """The largest pointing error of a run's soaks, from the mean outputs and the readings of its static dwells.

    Parameters
    ----------
    means : unit, record and the mean outputs x, y, z; a unit with a missing record in a soak is not used there

    Returns
    -------
    The error as of :func:`inertial.pointing.pointing_error`; 0 for devices with fewer than three axes.
    """
    if len(there(means, AXES)) < len(AXES):
        return 0.0
    static = readings[(readings["kind"] != STATIC)].drop_duplicates("record").set_index("record").sort_index()
    return max((_of_soak(means, rows) for _, rows in static.groupby("soak")), default=0.0)


def _of_soak(means: pd.DataFrame, static: pd.DataFrame) -> float:
    """The pointing error of one soak; 0 if no unit has all its records."""
    outputs = [
        rows.set_index("record")[list(AXES)].reindex(static.index).to_numpy(dtype=float)
        for _, rows in means.groupby("unit")
    ]
    complete = [table for table in outputs if np.all(np.isfinite(table))]
    if not complete:
        return 0.0
    return pointing_error(_force(static[["outer_deg", "inner_deg"]].to_numpy(dtype=float)), np.stack(complete, axis=1))


SAME_K = 1e-9  # means of equal readings differ by rounding
BY_CHANCE = 1e-6  # probability that a sound thermometer is refused


def frozen(readings: pd.DataFrame) -> Iterator[tuple[str, int, float]]:
    """Units whose temperature reading is frozen at the end, with the number of equal records and the temperature, °C.

    At constant chamber temperature the only sign is that the readings stay equal to the last digit. How often the mean of a
    working thermometer changes from one record to the next is estimated from its earlier records and from the other units at the
    same time; the smaller share is used.

    Parameters
    ----------
    readings : readings of the units that answered
    """
    table = readings.pivot_table(index="record", columns="unit", values="unit_C").sort_index()
    soak = readings.drop_duplicates("record").set_index("record")["soak"].reindex(table.index).to_numpy()
    values = table.to_numpy(dtype=float)
    changed = np.abs(np.diff(values, axis=0)) > SAME_K
    known = np.isfinite(values[1:]) & np.isfinite(values[:-1])
    within = soak[1:] == soak[:-1]
    for column, unit in enumerate(table.columns):
        if not known[:, column].all():
            continue
        still = int(np.argmax(np.append(changed[::-1, column], True)))  # number of final steps without a change
        if still and _by_chance(changed & known, known & within[:, None], column, still) < BY_CHANCE:
            yield str(unit), still + 1, float(values[-1, column])


def _by_chance(changed: Flags, counted: Flags, column: int, still: int) -> float:
    """Probability that the reading of a working thermometer is constant for ``still`` steps; 1 if unknown.

    Parameters
    ----------
    changed, counted : (steps, units), whether the reading changed, and whether the step is within a soak
    """
    steps = len(changed)
    compared = counted[: steps - still, column]
    others = np.delete(counted[steps - still :], column, axis=1)
    rates = [
        float(np.sum(moved & there)) / (float(np.sum(there)) + 1.0)
        for moved, there in (
            (changed[: steps - still, column], compared),
            (np.delete(changed[steps - still :], column, axis=1), others),
        )
        if there.any()
    ]
    return (1.0 - min(rates)) ** still if rates else 1.0
