"""The population: yield, capability, differences between stations, slots and lots, and outliers."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from inertial.arrays import NORMAL_MEDIAN, Array, Flags, Index, Texts
from inertial.population.capability import Index as Capability
from inertial.population.capability import cpk, fraction_interval, independent, shape_of, sigma_within
from inertial.population.comparison import Comparison, compare, holm, outlier_limit, robust_z, unlike
from inertial.population.two_way import group_medians
from pipelines.audit.calibrations import Calibrations, codes, date_of
from pipelines.audit.drifts import OF_UNIT
from pipelines.audit.index import AuditIndex
from pipelines.audit.pairs import first_of_each

FEWEST = 20
FEWEST_OF_LOT = 3
MEDIAN_OVER_MEAN = 1.2533  # standard error of a median over that of a mean, normal values: √(π/2)


@dataclass(frozen=True)
class Share:
    """Share of units that passed, with the exact 95 % interval; for a device, a station or a month."""

    of: str
    name: str
    passed: int
    total: int
    interval: Capability


def yields(calibrations: Calibrations, chosen: Flags) -> list[Share]:
    """Yield of all units, by kind of device, by station and by month."""
    rows = np.flatnonzero(chosen & (calibrations.outcome != ""))
    passed = calibrations.outcome[rows] == "pass"
    months = np.array([date_of(day)[:7] for day in calibrations.day[rows]], dtype=object)
    out: list[Share] = []
    for grouping, names in (
        ("all", np.full(rows.size, "all", dtype=object)),
        ("device", calibrations.device[rows]),
        ("station", calibrations.station[rows]),
        ("month", months),
    ):
        kinds, number = np.unique(names.astype(str), return_inverse=True)
        totals, good = np.bincount(number, minlength=kinds.size), np.bincount(number, passed, minlength=kinds.size)
        out += [
            Share(grouping, str(n), int(g), int(t), fraction_interval(int(g), int(t)))
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
    comparison: Comparison
    p: float


@dataclass(frozen=True)
class Figures:
    """The figures of chosen calibrations: row among the calibrations, figure, value, limit."""

    row: Index
    figure: Texts
    value: Array
    limit: Array
    unit_text: Texts


def figures_of(index: AuditIndex, calibrations: Calibrations, chosen: Flags) -> Figures:
    """Figures of the chosen calibrations."""
    frame = index.table("figures", ["run", "unit", "figure", "value", "limit", "unit_text"]).to_pandas()
    keys = pd.DataFrame({"row": np.flatnonzero(chosen)})
    for name, texts in (("run", calibrations.run), ("unit", calibrations.unit)):
        frame[name] = frame[name].astype("category")
        keys[name] = pd.Categorical(texts[chosen], categories=frame[name].cat.categories)
    # an index grown run by run and one made again hold the same rows in another order; sums must not depend on it
    frame = frame.merge(keys, on=["run", "unit"]).sort_values("row", kind="stable")
    return Figures(
        frame["row"].to_numpy(np.int64),
        frame["figure"].astype(str).to_numpy(object),
        frame["value"].to_numpy(float),
        frame["limit"].to_numpy(float),
        frame["unit_text"].astype(str).to_numpy(object),
    )


def abilities(calibrations: Calibrations, figures: Figures) -> tuple[list[Ability], list[Difference]]:
    """Capability of every figure with a limit, and tests for differences between stations, slots and lots.

    Every unit counts once, with its first calibration, because repeated calibrations are not independent.
    """
    figures = _first_of_each(calibrations, figures)
    device, lot = calibrations.device[figures.row].astype(str), codes(calibrations.run[figures.row])
    groups = {"station": codes(calibrations.station[figures.row]), "slot": calibrations.slot[figures.row], "lot": lot}
    able, differences = list[Ability](), list[Difference]()
    for kind in np.unique(device):
        for name in np.unique(figures.figure[device == kind].astype(str)):
            rows = np.flatnonzero((device == kind) & (figures.figure == name) & np.isfinite(figures.value))
            if rows.size < FEWEST or np.ptp(figures.value[rows]) == 0.0:
                continue
            limit = figures.limit[rows]
            if np.isfinite(limit).any():
                able.append(_ability(kind, name, figures, rows[np.isfinite(limit)], lot))
            for by, numbers in groups.items():
                comparison = _compared(figures.value[rows], numbers[rows] - numbers[rows].min(), lot[rows], by)
                if comparison is not None:
                    differences.append(Difference(kind, name, by, comparison, comparison.rank_p))
    adjusted = holm(np.array([d.p for d in differences])) if differences else []
    return able, [replace(d, p=float(p)) for d, p in zip(differences, adjusted, strict=True)]


def _compared(values: Array, groups: Index, lot: Index, by: str) -> Comparison | None:
    """Groups of values compared; stations by the means of their lots: lots differ, and each is on one station."""
    comparison = compare(values, groups)
    if comparison is None or by != "station":
        return comparison
    _, first, number = np.unique(lot, return_index=True, return_inverse=True)
    means = compare(np.bincount(number, values) / np.bincount(number), groups[first])
    return None if means is None else replace(comparison, f_p=means.f_p, rank_p=means.rank_p)


def _first_of_each(calibrations: Calibrations, figures: Figures) -> Figures:
    """The figures of every unit's first calibration among those given."""
    rows = np.unique(figures.row)
    first = np.isin(figures.row, rows[first_of_each(calibrations.histories[rows])])
    return Figures(*(getattr(figures, name)[first] for name in Figures.__dataclass_fields__))


def _ability(device: str, figure: str, figures: Figures, rows: Index, lot: Index) -> Ability:
    values, limit = figures.value[rows], float(np.median(figures.limit[rows]))
    two_sided = bool((values < 0.0).any())
    low = -limit if two_sided else -np.inf
    mean, sigma = float(values.mean()), float(values.std(ddof=1))
    within, dof = sigma_within(values, lot[rows])
    shape = (0.0, 3.0) if two_sided else shape_of(values)
    outside = int(np.count_nonzero(np.abs(values) > figures.limit[rows]))
    return Ability(
        device, figure, str(figures.unit_text[rows[0]]), limit, two_sided, rows.size, float(np.median(values)),
        cpk(mean, sigma, low, limit, *independent(values, lot[rows]), shape),
        cpk(mean, within, low, limit, dof + 1, None, shape) if dof >= FEWEST and within > 0.0 else None,
        fraction_interval(outside, rows.size),
    )  # fmt: skip


@dataclass(frozen=True)
class Odd:
    """A lot or a unit that is an outlier of its kind in a parameter, with its distance in σ (median and MAD of the others)."""

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


def odd_ones(calibrations: Calibrations, chosen: Flags) -> list[Odd]:
    """Lots and single units that are outliers at their first calibration, the furthest first; each once, by its worst parameter.

    Only the first calibration of a unit counts, so that frequent calibrations have no larger weight.
    """
    first = first_of_each(calibrations.histories)
    first = first[chosen[first]]
    out: list[Odd] = []
    for device in np.unique(calibrations.device.astype(str)):
        rows = first[calibrations.device[first] == device]
        values = np.stack([calibrations.column(name)[rows] for name in OF_UNIT], axis=1)
        usable = np.isfinite(values).any(axis=0)
        if rows.size < FEWEST or not usable.any():
            continue
        values = np.where(usable, values, 0.0)  # a parameter that no unit has is alike in all
        lots = _odd_lots(calibrations, device, rows, values)
        out += [*lots, *_odd_units(calibrations, device, rows, values, {lot.run for lot in lots})]
    return sorted(out, key=lambda odd: (odd.kind, -abs(odd.z), odd.name))


def _odd_units(calibrations: Calibrations, device: str, rows: Index, values: Array, odd_lots: set[str]) -> list[Odd]:
    z = np.nan_to_num(robust_z(values))
    return [
        Odd("unit", str(calibrations.unit[row]), device, str(calibrations.station[row]), str(calibrations.run[row]),
            float(calibrations.day[row]), OF_UNIT[column], float(values[k, column]), float(z[k, column]), 1)
        for k, column in _outliers(z)
        if str(calibrations.run[row := rows[k]]) not in odd_lots
    ]  # fmt: skip


def _outliers(z: Array) -> list[tuple[int, int]]:
    """Rows of distances in σ (n, p) whose largest entry is an outlier, with its column."""
    worst = np.argmax(np.abs(z), axis=1)
    size = np.abs(z[np.arange(len(z)), worst])
    return [(int(k), int(worst[k])) for k in np.flatnonzero(size > outlier_limit(z.size, len(z)))]


def _error_of_lots(values: Array, lot: Index) -> Array:
    """Standard error of the median of every lot, (lots, p), from the spread inside the lots."""
    counts = np.bincount(lot)
    middles = np.stack([group_medians(column, lot) for column in values.T], axis=1)
    freed = (values - middles[lot]) * np.sqrt(counts / np.maximum(counts - 1, 1))[lot, None]
    inside = np.nanmedian(np.abs(freed[counts[lot] > 1]), axis=0) / NORMAL_MEDIAN
    return MEDIAN_OVER_MEAN * inside / np.sqrt(counts)[:, None]


def _odd_lots(calibrations: Calibrations, device: str, rows: Index, values: Array) -> list[Odd]:
    runs, lot = np.unique(calibrations.run[rows].astype(str), return_inverse=True)
    counts = np.bincount(lot)
    large = np.flatnonzero(counts >= FEWEST_OF_LOT)
    if large.size < FEWEST:
        return []
    # medians, so that a single outlier is reported as a unit and not as its lot
    means = np.stack([group_medians(values[:, c], lot) for c in range(values.shape[1])], axis=1)[large]
    z = np.nan_to_num(unlike(means, _error_of_lots(values, lot)[large]))
    out: list[Odd] = []
    for k, column in _outliers(z):
        run = str(runs[large[k]])
        row = rows[np.flatnonzero(lot == large[k])[0]]
        out.append(
            Odd("lot", run, device, str(calibrations.station[row]), run, float(calibrations.day[row]), OF_UNIT[column],
                float(means[k, column]), float(z[k, column]), int(counts[large[k]]))
        )  # fmt: skip
    return out
