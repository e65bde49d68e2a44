"""Gauge studies in the archive: the same units seated repeatedly within days, on one or several stations."""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Flags, Index
from inertial.population.gauge import Gauge, gauge_study
from pipelines.audit.calibrations import Calibrations
from pipelines.audit.drifts import OF_UNIT
from pipelines.audit.pairs import first_of_each
from pipelines.audit.parameters import FAMILY_OF
from pipelines.audit.rules import Rules

SIX_SIGMA = 6.0
FEWEST_PARTS = 3


@dataclass(frozen=True)
class Study:
    """A gauge study of one parameter: stations, days, results, and its share of the tolerance in %."""

    device: str
    parameter: str
    stations: tuple[str, ...]
    first_day: float
    last_day: float
    runs: tuple[str, ...]
    gauge: Gauge
    of_tolerance: float


def studies(calibrations: Calibrations, good: Flags, rules: Rules) -> list[Study]:
    """Every gauge study of every parameter; the units are the parts, the stations the appraisers."""
    out: list[Study] = []
    for group in _groups(calibrations, good, rules.gauge_days):
        chosen = _crossed(calibrations, group)
        if chosen is None:
            continue
        stations, rows = chosen
        device = str(calibrations.device[rows[0, 0, 0]])
        days = calibrations.day[rows]
        runs = tuple(sorted({str(run) for run in calibrations.run[rows].ravel()}))
        for name in OF_UNIT:
            values = calibrations.column(name)[rows]
            if np.isfinite(values).all():
                components = gauge_study(values)
                share = 100.0 * SIX_SIGMA * components.gauge / (2.0 * rules.tolerance_of(device, FAMILY_OF[name]))
                out.append(Study(device, name, stations, float(days.min()), float(days.max()), runs, components, share))
    return out


def _groups(calibrations: Calibrations, good: Flags, within_days: float) -> list[dict[str, Index]]:
    """Sets of runs on exactly the same units within some days; by run, the rows of its units in order of serial."""
    rows = np.flatnonzero(good)
    order = rows[np.lexsort((calibrations.unit[rows].astype(str), calibrations.run[rows].astype(str)))]
    starts = first_of_each(calibrations.run[order].astype(str))
    by_units: dict[tuple[str, ...], list[Index]] = {}
    for of_run in np.split(order, starts[1:]):
        if of_run.size >= FEWEST_PARTS:
            by_units.setdefault(tuple(calibrations.unit[of_run]), []).append(of_run)
    out: list[dict[str, Index]] = []
    for members in by_units.values():
        members.sort(key=lambda of_run: (float(calibrations.day[of_run[0]]), str(calibrations.run[of_run[0]])))
        part: list[Index] = []
        for of_run in [*members, None]:
            if part and (of_run is None or calibrations.day[of_run[0]] - calibrations.day[part[0][0]] > within_days):
                if len(part) > 1:
                    out.append({str(calibrations.run[mounting[0]]): mounting for mounting in part})
                part = []
            if of_run is not None:
                part.append(of_run)
    return out


def _crossed(calibrations: Calibrations, group: dict[str, Index]) -> tuple[tuple[str, ...], Index] | None:
    """Stations, and rows (parts, stations, mounts) of a study with equal numbers of mounts; None without repeats."""
    by_station: dict[str, list[Index]] = {}
    for rows in group.values():
        by_station.setdefault(str(calibrations.station[rows[0]]), []).append(rows)
    repeated = {station: runs for station, runs in sorted(by_station.items()) if len(runs) > 1}
    if not repeated:
        return None
    mounts = min(len(runs) for runs in repeated.values())
    stacked = np.stack([np.stack(runs[:mounts], axis=-1) for runs in repeated.values()], axis=1)
    return tuple(repeated), stacked
