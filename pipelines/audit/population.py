"""The population: yield, capability against the limits, what differs between stations, slots and lots, and what stands out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from inertial.population.capability import Index as Capability
from inertial.population.capability import cpk, fraction_interval, independent, sigma_within
from inertial.population.comparison import Comparison, compare, holm, outlier_limit, robust_z, unlike
from inertial.population.memory import TO_SIGMA
from inertial.population.two_way import group_medians
from pipelines.audit.calibrations import codes, date_of
from pipelines.audit.drifts import OWN

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from pipelines.audit.calibrations import Calibrations
    from pipelines.audit.index import AuditIndex

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]
    Texts = NDArray[np.object_]
    Numbers = NDArray[np.int64]

FEWEST = 20
FEWEST_OF_LOT = 3
MEDIAN_OVER_MEAN = 1.2533  # standard error of a median over that of a mean, normal values: √(π/2)


@dataclass(frozen=True)
class Share:
    """Units that passed, of how many, with the exact 95 % interval; of a device, a station or a month."""

    of: str
    name: str
    passed: int
    total: int
    interval: Capability


def yields(all_: Calibrations, chosen: Flags) -> list[Share]:
    """Yield in all, by kind of device, by station and by month."""
    rows = np.flatnonzero(chosen & (all_.outcome != ""))
    passed = all_.outcome[rows] == "pass"
    months = np.array([date_of(day)[:7] for day in all_.day[rows]], dtype=object)
    out: list[Share] = []
    for of, names in (
        ("all", np.full(rows.size, "all", dtype=object)),
        ("device", all_.device[rows]),
        ("station", all_.station[rows]),
        ("month", months),
    ):
        kinds, number = np.unique(names.astype(str), return_inverse=True)
        totals, good = np.bincount(number, minlength=kinds.size), np.bincount(number, passed, minlength=kinds.size)
        out += [
            Share(of, str(n), int(g), int(t), fraction_interval(int(g), int(t)))
            for n, g, t in zip(kinds, good, totals, strict=True)
        ]
    return out


@dataclass(frozen=True)
class Ability:
    """Capability of one figure of one kind of device: Ppk of all values, Cpk from the spread inside the lots, share outside."""

    device: str
    figure: str
    unit_text: str
    limit: float
    two_sided: bool
    n: int
    median: float
    ppk: Capability
    cpk: Capability | None
    outside: Capability


@dataclass(frozen=True)
class Difference:
    """Groups of one figure compared; p is adjusted for the number of all comparisons (Holm), of the rank test."""

    device: str
    figure: str
    by: str
    found: Comparison
    p: float


@dataclass(frozen=True)
class Figures:
    """The figures of chosen calibrations: row among the calibrations, figure, value, limit."""

    row: Numbers
    figure: Texts
    value: Array
    limit: Array
    unit_text: Texts


def figures_of(index: AuditIndex, all_: Calibrations, chosen: Flags) -> Figures:
    """Figures of the chosen calibrations."""
    frame = index.table("figures", ["run", "unit", "figure", "value", "limit", "unit_text"]).to_pandas()
    runs, run = np.unique(all_.run.astype(str), return_inverse=True)
    units, unit = np.unique(all_.unit.astype(str), return_inverse=True)
    own = run.astype(np.int64) * max(units.size, 1) + unit
    order = np.argsort(own)
    wanted_run, wanted_unit = (_numbers_in(frame[n], known) for n, known in (("run", runs), ("unit", units)))
    key = wanted_run * max(units.size, 1) + wanted_unit
    place = np.minimum(np.searchsorted(own[order], key), max(own.size - 1, 0))
    found = (wanted_run >= 0) & (wanted_unit >= 0)
    if own.size:
        found &= own[order][place] == key
        row = order[place]
        found &= chosen[row]
    else:
        row = place
    return Figures(
        row[found],
        frame["figure"].astype(str).to_numpy(object)[found],
        frame["value"].to_numpy(float)[found],
        frame["limit"].to_numpy(float)[found],
        frame["unit_text"].astype(str).to_numpy(object)[found],
    )


def _numbers_in(column: pd.Series, known: NDArray[np.str_]) -> Numbers:
    """Place of every text of a categorical column in the sorted texts that are known; −1 where it is not."""
    column = column.astype("category")
    categories = np.asarray(column.cat.categories, dtype=str)
    place = np.searchsorted(known, categories)
    there = place < known.size
    there[there] = known[place[there]] == categories[there]
    return np.where(there, place, -1)[np.asarray(column.cat.codes)]


def abilities(all_: Calibrations, figures: Figures) -> tuple[list[Ability], list[Difference]]:
    """Capability of every figure with a limit, and whether stations, slots and lots differ in it.

    Every unit counts once, as it first was: one that comes back to its station again and again is no new evidence of it.
    """
    figures = _first_of_each(all_, figures)
    device, lot = all_.device[figures.row].astype(str), codes(all_.run[figures.row])
    groups = {"station": codes(all_.station[figures.row]), "slot": all_.slot[figures.row], "lot": lot}
    able: list[Ability] = []
    differences: list[Difference] = []
    for kind in np.unique(device):
        for name in np.unique(figures.figure[device == kind].astype(str)):
            own = np.flatnonzero((device == kind) & (figures.figure == name) & np.isfinite(figures.value))
            if own.size < FEWEST or np.ptp(figures.value[own]) == 0.0:
                continue
            limit = figures.limit[own]
            if np.isfinite(limit).any():
                able.append(_ability(kind, name, figures, own[np.isfinite(limit)], lot))
            for by, numbers in groups.items():
                found = _compared(figures.value[own], numbers[own] - numbers[own].min(), lot[own], by)
                if found is not None:
                    differences.append(Difference(kind, name, by, found, found.rank_p))
    adjusted = holm(np.array([d.p for d in differences])) if differences else []
    return able, [replace(d, p=float(p)) for d, p in zip(differences, adjusted, strict=True)]


def _compared(values: Array, groups: Numbers, lot: Numbers, by: str) -> Comparison | None:
    """Groups of values compared; stations by the means of their lots: lots differ, and each is on one station."""
    found = compare(values, groups)
    if found is None or by != "station":
        return found
    _, first, number = np.unique(lot, return_index=True, return_inverse=True)
    means = compare(np.bincount(number, values) / np.bincount(number), groups[first])
    return None if means is None else replace(found, f_p=means.f_p, rank_p=means.rank_p)


def _first_of_each(all_: Calibrations, figures: Figures) -> Figures:
    """The figures of every unit's first calibration among those given."""
    rows = np.unique(figures.row)
    unit = all_.histories[rows]
    first = rows[np.concatenate([[True], unit[1:] != unit[:-1]])] if rows.size else rows
    kept = np.isin(figures.row, first)
    return Figures(*(getattr(figures, name)[kept] for name in Figures.__dataclass_fields__))


def _ability(device: str, figure: str, figures: Figures, own: Numbers, lot: Numbers) -> Ability:
    values, limit = figures.value[own], float(np.median(figures.limit[own]))
    two_sided = bool((values < 0.0).any())
    low = -limit if two_sided else -np.inf
    mean, sigma = float(values.mean()), float(values.std(ddof=1))
    within, dof = sigma_within(values, lot[own])
    outside = int(np.count_nonzero(np.abs(values) > figures.limit[own]))
    return Ability(
        device, figure, str(figures.unit_text[own[0]]), limit, two_sided, own.size, float(np.median(values)),
        cpk(mean, sigma, low, limit, *independent(values, lot[own])),
        cpk(mean, within, low, limit, dof + 1) if dof >= FEWEST and within > 0.0 else None,
        fraction_interval(outside, own.size),
    )  # fmt: skip


@dataclass(frozen=True)
class Odd:
    """A lot or a unit that stands out of its kind in a parameter, by so many σ (median and MAD of the others)."""

    kind: str
    name: str
    device: str
    station: str
    run: str
    day: float
    parameter: str
    value: float
    z: float
    units: int


def odd_ones(all_: Calibrations, chosen: Flags) -> list[Odd]:
    """Lots and single units that stand out when they are new, the furthest first; each once, by its worst parameter.

    Units are looked at in their first calibration only, so that what comes back often does not weigh more.
    """
    first = (
        np.concatenate([[True], all_.histories[1:] != all_.histories[:-1]]) if len(all_) else np.zeros(0, dtype=bool)
    )
    out: list[Odd] = []
    for device in np.unique(all_.device.astype(str)):
        rows = np.flatnonzero(chosen & first & (all_.device == device))
        values = np.stack([all_.column(name)[rows] for name in OWN], axis=1)
        usable = np.isfinite(values).any(axis=0)
        if rows.size < FEWEST or not usable.any():
            continue
        lots = _odd_lots(all_, device, rows, values)
        out += [*lots, *_odd_units(all_, device, rows, values, {lot.run for lot in lots})]
    return sorted(out, key=lambda odd: (odd.kind, -abs(odd.z), odd.name))


def _odd_units(all_: Calibrations, device: str, rows: Numbers, values: Array, odd_lots: set[str]) -> list[Odd]:
    z = np.nan_to_num(robust_z(values))
    worst = np.argmax(np.abs(z), axis=1)
    size = np.abs(z[np.arange(rows.size), worst])
    found: list[Odd] = []
    for k in np.flatnonzero(size > outlier_limit(z.size, rows.size)):
        row, column = rows[k], worst[k]
        if str(all_.run[row]) not in odd_lots:
            found.append(
                Odd("unit", str(all_.unit[row]), device, str(all_.station[row]), str(all_.run[row]), float(all_.day[row]),
                    OWN[column], float(values[k, column]), float(z[k, column]), 1)
            )  # fmt: skip
    return found


def _error_of_lots(values: Array, lot: Numbers) -> Array:
    """Standard error of the median of every lot, (lots, p), from the spread inside the lots."""
    counts = np.bincount(lot)
    middles = np.stack([group_medians(column, lot) for column in values.T], axis=1)
    freed = (values - middles[lot]) * np.sqrt(counts / np.maximum(counts - 1, 1))[lot, None]
    inside = TO_SIGMA * np.nanmedian(np.abs(freed[counts[lot] > 1]), axis=0)
    return MEDIAN_OVER_MEAN * inside / np.sqrt(counts)[:, None]


def _odd_lots(all_: Calibrations, device: str, rows: Numbers, values: Array) -> list[Odd]:
    runs, lot = np.unique(all_.run[rows].astype(str), return_inverse=True)
    counts = np.bincount(lot)
    large = np.flatnonzero(counts >= FEWEST_OF_LOT)
    if large.size < FEWEST:
        return []
    # medians: one wild unit is told as a unit, not as its lot
    means = np.stack([group_medians(values[:, c], lot) for c in range(values.shape[1])], axis=1)[large]
    z = np.nan_to_num(unlike(means, _error_of_lots(values, lot)[large]))
    worst = np.argmax(np.abs(z), axis=1)
    size = np.abs(z[np.arange(large.size), worst])
    out: list[Odd] = []
    for k in np.flatnonzero(size > outlier_limit(z.size, large.size)):
        run, column = str(runs[large[k]]), worst[k]
        row = rows[np.flatnonzero(lot == large[k])[0]]
        out.append(
            Odd("lot", run, device, str(all_.station[row]), run, float(all_.day[row]), OWN[column],
                float(means[k, column]), float(z[k, column]), int(counts[large[k]]))
        )  # fmt: skip
    return out
