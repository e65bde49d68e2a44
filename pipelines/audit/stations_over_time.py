"""The stations over time: their effects run by run, their slots, and their check standards."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from inertial.arrays import Array, Flags, Index, Texts
from inertial.population.change_points import ChangePoint, change_points, noise_of
from inertial.population.control_charts import Baseline, alarms, baseline, chance_of_alarms, signals
from inertial.population.two_way import unit_and_place
from pipelines.audit.calibrations import Calibrations, codes
from pipelines.audit.drifts import OF_UNIT
from pipelines.audit.parameters import unit_text
from pipelines.audit.rules import Rules

LEVEL = 1e-3  # p-value of a change, shared by all series
FEWEST = 8
TURNS = ("rotation_x", "rotation_y", "rotation_z")
CHART_LEVEL = 0.01  # p-value of the number of alarms, shared by all charts


@dataclass(frozen=True)
class StationSeries:
    """One quantity of one station in order of time, (n,) each, and where its level changed.

    where : the effect of the station, or a slot; unit_text : of the values
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
    """The effects of each station, from the common part of the residuals of its runs.

    Parameters
    ----------
    station : run, effect, name, value in µrad; runs : run, day, station
    """
    frame = station.merge(runs, on="run").sort_values(["day", "run"], kind="stable")
    by_effect = frame.groupby(["station", "effect", "name"], observed=True)
    groups = [(key, rows) for key, rows in by_effect if len(rows) >= FEWEST]
    return [
        _series((str(where), str(effect), str(name)), rows["day"].to_numpy(), rows["value"].to_numpy(),
                rows["run"].to_numpy(object), LEVEL / len(groups))
        for (where, effect, name), rows in groups
    ]  # fmt: skip


def slot_series(calibrations: Calibrations, good: Flags) -> tuple[list[StationSeries], list[dict[str, object]]]:
    """The rotation of every slot from its units, and its mean over all time; only units with several slots identify it.

    The rotation of a unit is the sum of its own and its seat's. Units that return in other slots separate the two; the
    remainder, slot by slot in order of time, is the change of the seat.
    """
    several = np.bincount(calibrations.histories, minlength=1)[calibrations.histories] > 1
    rows = np.flatnonzero(good & several & np.isfinite(calibrations.column(TURNS[0])))
    if rows.size < FEWEST:
        return [], []
    units = codes(calibrations.histories[rows].astype(str))
    seats = [f"{s} slot {n}" for s, n in zip(calibrations.station[rows], calibrations.slot[rows], strict=True)]
    names, seat_of = np.unique(seats, return_inverse=True)
    out: list[StationSeries] = []
    means: dict[str, dict[str, object]] = {str(name): {"where": str(name)} for name in names}
    for turn in TURNS:
        values = 1e3 * calibrations.column(turn)[rows]
        unit, seat = unit_and_place(values, units, seat_of)
        left = values - unit[units]
        for number, name in enumerate(names):
            means[str(name)][f"{turn}_urad"] = float(seat[number])
            of_seat = rows[seat_of == number]
            order = np.lexsort((calibrations.run[of_seat].astype(str), calibrations.day[of_seat]))
            if of_seat.size >= FEWEST:
                station, _, slot = str(name).rpartition(" slot ")
                key = (station, f"slot {slot}", turn)
                rest, level = left[seat_of == number][order], LEVEL / (names.size * len(TURNS))
                out.append(
                    _series(key, calibrations.day[of_seat][order], rest, calibrations.run[of_seat][order], level)
                )
    return out, list(means.values())


def _series(key: tuple[str, str, str], day: Array, value: Array, run: Texts, level: float) -> StationSeries:
    changes = change_points(np.asarray(value, dtype=float), level)
    return StationSeries(*key, "µrad", day, value, run, noise_of(value), tuple(changes))


@dataclass(frozen=True)
class ControlChart:
    """A control chart of one parameter of one check standard on one station, in order of time, (n,) each.

    rules : (4, n), by Western Electric rule; outside : points with the EWMA outside its limits
    alarms : number of signals of the rules and of averages outside; expected : number for a station in control
    p_value : probability of as many alarms by chance
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
    outside: Flags
    alarms: int
    expected: float
    p_value: float
    in_control: bool

    @property
    def hit(self) -> Flags:
        """Points with a signal of a rule or of the average, (n,)."""
        return self.rules.any(axis=0) | self.outside


def charts(calibrations: Calibrations, rules: Rules, since: float) -> list[ControlChart]:
    """The charts of all check standards; signals count from ``since`` on, and after the points that make the baseline."""
    rows = np.flatnonzero([rules.is_standard(unit) for unit in calibrations.unit])
    keys = np.array([f"{calibrations.station[k]}\t{calibrations.unit[k]}" for k in rows], dtype=object)
    out: list[ControlChart] = []
    for key in np.unique(keys.astype(str)):
        of_standard = rows[keys == key]
        order = np.lexsort((calibrations.run[of_standard].astype(str), calibrations.day[of_standard]))
        of_standard = of_standard[order]
        station, unit = str(key).split("\t")
        for name in OF_UNIT:
            values = calibrations.column(name)[of_standard]
            finite = np.isfinite(values)
            if finite.sum() > rules.baseline_points:
                out.append(
                    _chart(calibrations, of_standard[finite], (station, unit, name), values[finite], rules, since)
                )
    level = CHART_LEVEL / max(len(out), 1)
    return [replace(chart, in_control=chart.p_value >= level) for chart in out]


def _chart(
    calibrations: Calibrations,
    rows: Index,
    key: tuple[str, str, str],
    values: Array,
    rules: Rules,
    since: float,
) -> ControlChart:
    chart = baseline(values, rules.baseline_points)
    by_rule, moving = signals(values, chart)
    day = calibrations.day[rows]
    counted = (np.arange(values.size) >= rules.baseline_points) & (day >= since)
    number = alarms(by_rule, moving.outside, counted)
    chance = chance_of_alarms(values, rules.baseline_points, int(counted.sum()))
    return ControlChart(
        *key, unit_text(key[2]), day, values, calibrations.run[rows], chart, by_rule & counted, moving.average,
        moving.outside & counted, number, chance.mean, chance.p_value(number), in_control=True,
    )  # fmt: skip
