"""The stations watched over the weeks: their own effects run by run, their slots, and their check standards."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from inertial.population.change_points import ChangePoint, change_points, noise_of
from inertial.population.control_charts import Baseline, alarms, baseline, chance_of_alarms, signals
from inertial.population.two_way import unit_and_place
from pipelines.audit.calibrations import codes
from pipelines.audit.drifts import OWN
from pipelines.audit.parameters import unit_text

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from pipelines.audit.calibrations import Calibrations
    from pipelines.audit.rules import Rules

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]
    Texts = NDArray[np.object_]

LEVEL = 1e-3  # p-value of a change, shared by all series
FEWEST = 8
TURNS = ("rotation_x", "rotation_y", "rotation_z")
CHART_LEVEL = 0.01  # p-value of the number of alarms, shared by all charts


@dataclass(frozen=True)
class StationSeries:
    """One quantity of one station in order of time, (n,) each, and where its level changed.

    where : of what: the station's effect, or a slot; unit_text : of the values
    """

    station: str
    where: str
    parameter: str
    unit_text: str
    day: Array
    value: Array
    run: Texts
    noise: float
    changes: tuple[ChangePoint, ...]


def station_series(station: pd.DataFrame, runs: pd.DataFrame) -> list[StationSeries]:
    """The station's effects, station by station: what the residuals of its runs had in common.

    Parameters
    ----------
    station : run, effect, name, value in µrad; runs : run, day, station
    """
    frame = station.merge(runs, on="run").sort_values(["day", "run"], kind="stable")
    groups = [
        (key, rows) for key, rows in frame.groupby(["station", "effect", "name"], observed=True) if len(rows) >= FEWEST
    ]
    return [
        _series((str(where), str(effect), str(name)), "µrad", rows["day"].to_numpy(), rows["value"].to_numpy(),
                rows["run"].to_numpy(object), LEVEL / len(groups))
        for (where, effect, name), rows in groups
    ]  # fmt: skip


def slot_series(all_: Calibrations, good: Flags) -> tuple[list[StationSeries], list[dict[str, object]]]:
    """The rotation of every slot as its units show it, and its mean over all time: only units that sat elsewhere too tell it.

    A unit's rotation is its own and its seat's. Over units that come back in other slots the two are taken apart; what is
    left, slot by slot in order of time, is the seat's change.
    """
    several = np.bincount(all_.histories, minlength=1)[all_.histories] > 1
    rows = np.flatnonzero(good & several & np.isfinite(all_.column(TURNS[0])))
    if rows.size < FEWEST:
        return [], []
    units = codes(all_.histories[rows].astype(str))
    seats = np.array([f"{s} slot {n}" for s, n in zip(all_.station[rows], all_.slot[rows], strict=True)], dtype=object)
    names, place = np.unique(seats.astype(str), return_inverse=True)
    out: list[StationSeries] = []
    means: dict[str, dict[str, object]] = {str(name): {"where": str(name)} for name in names}
    for turn in TURNS:
        values = 1e3 * all_.column(turn)[rows]
        unit, seat = unit_and_place(values, units, place)
        left = values - unit[units]
        for number, name in enumerate(names):
            means[str(name)][f"{turn}_urad"] = float(seat[number])
            own = rows[place == number]
            order = np.lexsort((all_.run[own].astype(str), all_.day[own]))
            if own.size >= FEWEST:
                station, _, slot = str(name).rpartition(" slot ")
                key = (station, f"slot {slot}", turn)
                rest = left[place == number][order]
                level = LEVEL / (names.size * len(TURNS))
                out.append(_series(key, "µrad", all_.day[own][order], rest, all_.run[own][order], level))
    return out, list(means.values())


def _series(key: tuple[str, str, str], text: str, day: Array, value: Array, run: Texts, level: float) -> StationSeries:
    station, where, parameter = key
    changes = change_points(np.asarray(value, dtype=float), level)
    return StationSeries(station, where, parameter, text, day, value, run, noise_of(value), tuple(changes))


@dataclass(frozen=True)
class Chart:
    """A control chart of one parameter of one check standard on one station, in order of time, (n,) each.

    rules : (4, n), by Western Electric rule; outside : where the EWMA is beyond its limits
    alarms : number of signals of the rules and of averages outside; expected : of a station in control
    p_value : of as many alarms by chance
    """

    station: str
    standard: str
    parameter: str
    unit_text: str
    day: Array
    value: Array
    run: Texts
    chart: Baseline
    rules: Flags
    average: Array
    half_width: Array
    outside: Flags
    alarms: int
    expected: float
    p_value: float
    in_control: bool


def charts(all_: Calibrations, rules: Rules, since: float) -> list[Chart]:
    """The charts of all check standards; signals count from ``since`` on, and after the points that make the baseline."""
    standard = np.array([rules.is_standard(unit) for unit in all_.unit], dtype=bool)
    rows = np.flatnonzero(standard)
    keys = np.array([f"{all_.station[k]}\t{all_.unit[k]}" for k in rows], dtype=object)
    out: list[Chart] = []
    for key in np.unique(keys.astype(str)) if rows.size else ():
        own = rows[keys == key]
        own = own[np.lexsort((all_.run[own].astype(str), all_.day[own]))]
        station, unit = str(key).split("\t")
        for name in OWN:
            values = all_.column(name)[own]
            kept = np.isfinite(values)
            if kept.sum() > rules.baseline_points:
                chosen = own[kept]
                out.append(_chart(all_, chosen, (station, unit, name), values[kept], rules, since))
    level = CHART_LEVEL / max(len(out), 1)
    return [replace(chart, in_control=chart.p_value >= level) for chart in out]


def _chart(
    all_: Calibrations, own: NDArray[np.int64], key: tuple[str, str, str], values: Array, rules: Rules, since: float
) -> Chart:
    chart = baseline(values, rules.baseline_points)
    found, moving = signals(values, chart)
    day = all_.day[own]
    counted = (np.arange(values.size) >= rules.baseline_points) & (day >= since)
    number = alarms(found, moving.outside, counted)
    chance = chance_of_alarms(values, rules.baseline_points, int(counted.sum()))
    return Chart(
        *key, unit_text(key[2]), day, values, all_.run[own], chart, found & counted, moving.average, moving.half_width,
        moving.outside & counted, number, chance.mean, chance.p_value(number), in_control=True,
    )  # fmt: skip
