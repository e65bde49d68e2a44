"""The whole audit of an archive, from the index to the findings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipelines.audit.calibrations import Calibrations, captures_of, later, load, runs_of, undated
from pipelines.audit.certificates import Certificates, certificates_of
from pipelines.audit.drifts import KindDrift, UnitDrift, kind_drifts, unit_drifts
from pipelines.audit.due import Due, due, last_measured
from pipelines.audit.gauge_mounts import Study, studies
from pipelines.audit.index import up_to_date
from pipelines.audit.population import (
    Ability,
    Difference,
    Figures,
    Odd,
    Share,
    abilities,
    figures_of,
    odd_ones,
    yields,
)
from pipelines.audit.stations_over_time import Chart, StationSeries, charts, slot_series, station_series
from pipelines.audit.swaps import Stranger, strangers

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipelines.archive import Archive
    from pipelines.audit.rules import Rules
    from pipelines.parallel import Spread

    Flags = NDArray[np.bool_]

LIMITED = {  # families whose value itself has a limit: figure, and the parameter's unit per unit of the figure
    "bias": ("zero_g_offset_mg", 1e3),
    "bias_temperature": ("bias_temperature_ug_K", 1.0),
    "scale_temperature": ("scale_temperature_ppm_K", 1.0),
}


@dataclass(frozen=True)
class Scope:
    """What is looked at: days since 1970 (from ``since`` up to before ``until``), and a device or a station where named.

    tomorrow : the day after the one on which the audit is made; infinite where nobody says which that is
    """

    since: float
    until: float
    device: str = ""
    station: str = ""
    tomorrow: float = float("inf")


@dataclass(frozen=True)
class Audit:
    """Everything that an audit found.

    good : calibrations that are of the unit their serial names; product : those of no check standard
    period : those of the product that the scope chooses
    problems : runs that cannot be used, and why; later : runs that say that they were measured after today
    """

    scope: Scope
    rules: Rules
    all: Calibrations
    good: Flags
    product: Flags
    period: Flags
    problems: tuple[tuple[str, str], ...]
    later: tuple[tuple[str, float], ...]
    strangers: tuple[Stranger, ...]
    kinds: tuple[KindDrift, ...]
    units: dict[str, list[UnitDrift]]
    due: Due
    certificates: Certificates
    stations: tuple[StationSeries, ...]
    slots: tuple[StationSeries, ...]
    slot_means: tuple[dict[str, object], ...]
    charts: tuple[Chart, ...]
    yields: tuple[Share, ...]
    abilities: tuple[Ability, ...]
    differences: tuple[Difference, ...]
    odd: tuple[Odd, ...]
    studies: tuple[Study, ...]


def audit(archive: Archive, rules: Rules, scope: Scope, *, spread: Spread | None = None, workers: int = 1) -> Audit:
    """What an archive tells of its units, its stations and its population up to a day.

    Histories are looked at whole; ``since`` chooses which changes, signals and figures are told of.

    Parameters
    ----------
    spread, workers : where the runs are read, see :func:`pipelines.parallel.map_partitions`
    """
    index = up_to_date(archive, spread, workers)
    runs = runs_of(index, scope.until)
    all_ = load(index, runs)
    found = tuple(strangers(all_, rules))
    good = np.ones(len(all_), dtype=bool)
    good[[one.row for one in found]] = False
    product = ~np.array([rules.is_standard(str(unit)) for unit in all_.unit], dtype=bool)
    inside = product & _named(all_, scope)
    period = inside & (all_.day >= scope.since)
    figures = figures_of(index, all_, period)
    ledger = certificates_of(archive.root, scope.until, captures_of(index))
    kinds = kind_drifts(all_, good & inside, rules, scope.since)
    units = unit_drifts(all_, good & inside, kinds, rules, _limits(all_, figures))
    station = index.table("station").to_pandas()
    station["run"] = station["run"].astype(str)
    if scope.station:
        runs = runs[runs["station"] == scope.station]
    slots, means = slot_series(all_, good & product & _at(all_, scope))
    able, different = abilities(all_, figures)
    return Audit(
        scope=scope,
        rules=rules,
        all=all_,
        good=good,
        product=product,
        period=period,
        problems=(*_problems(index.table("runs", ["run", "problem"]).to_pydict()), *undated(index)),
        later=tuple(later(index, scope.tomorrow)),
        strangers=tuple(one for one in found if all_.day[one.row] >= scope.since),
        kinds=tuple(kinds),
        units=units,
        due=last_measured(
            all_, due(all_, good & product & _of_device(all_, scope), rules, kinds, units, ledger), scope.station
        ),
        certificates=ledger,
        stations=tuple(station_series(station, runs)),
        slots=tuple(slots),
        slot_means=tuple(means),
        charts=tuple(charts(all_.chosen(_at(all_, scope)), rules, scope.since)),
        yields=tuple(yields(all_, period)),
        abilities=tuple(able),
        differences=tuple(different),
        odd=tuple(odd_ones(all_, period)),
        studies=tuple(study for study in studies(all_, good & inside, rules) if study.last_day >= scope.since),
    )


def _named(all_: Calibrations, scope: Scope) -> Flags:
    return _of_device(all_, scope) & _at(all_, scope)


def _of_device(all_: Calibrations, scope: Scope) -> Flags:
    return np.array([not scope.device or str(d) == scope.device.upper() for d in all_.device], dtype=bool)


def _at(all_: Calibrations, scope: Scope) -> Flags:
    return np.full(len(all_), fill_value=True) if not scope.station else np.asarray(all_.station == scope.station)


def _problems(columns: dict[str, list[str]]) -> tuple[tuple[str, str], ...]:
    return tuple((run, text) for run, text in zip(columns["run"], columns["problem"], strict=True) if text)


def _limits(all_: Calibrations, figures: Figures) -> dict[tuple[str, str], float]:
    """The product's limits by device and family, as the calibrations looked at were decided."""
    out: dict[tuple[str, str], float] = {}
    for family, (figure, factor) in LIMITED.items():
        own = np.flatnonzero((figures.figure == figure) & np.isfinite(figures.limit))
        devices = all_.device[figures.row[own]]
        for device in np.unique(devices.astype(str)):
            out[str(device), family] = factor * float(np.median(figures.limit[own][devices == device]))
    return out
