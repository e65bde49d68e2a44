"""The audit of an archive, from the index to the results behind the findings."""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Flags, Index
from pipelines.archive import Archive
from pipelines.audit.calibrations import Calibrations, captures_of, dated_runs, day_of, first_runs, left_out, load
from pipelines.audit.drifts import KindDrift, kind_drifts
from pipelines.audit.due import Certificates, Due, certificates_of, due, last_measured
from pipelines.audit.exchanged_serials import Stranger, strangers
from pipelines.audit.gauge_mounts import Study, studies
from pipelines.audit.index import up_to_date
from pipelines.audit.population import Ability, Difference, Figures, Odd, Share, abilities, figures_of, odd_ones, yields
from pipelines.audit.rules import Rules
from pipelines.audit.stations_over_time import ControlChart, StationSeries, charts, slot_series, station_series
from pipelines.audit.unit_drifts import UnitDrift, unit_drifts
from pipelines.certificates.days import FIRST, today
from pipelines.certificates.days import day_of as checked
from pipelines.parallel import Distributor
from schemas.errors import WrongUse, did_you_mean

LIMITED = {  # families with a limit of the value: figure, and units of the parameter per unit of the figure
    "bias": ("zero_g_offset_mg", 1e3),
    "bias_temperature": ("bias_temperature_ug_K", 1.0),
    "scale_temperature": ("scale_temperature_ppm_K", 1.0),
}


@dataclass(frozen=True)
class Scope:
    """The scope of an audit: days since 1970 (``since`` included, ``until`` excluded), and one device or station where given.

    tomorrow : the day after the audit; infinite where unknown
    """

    since: float
    until: float
    device: str = ""
    station: str = ""
    tomorrow: float = float("inf")


def scope_of(since: str, until: str, device: str, station: str) -> Scope:
    """The scope of an audit from dates as texts; the day ``until`` is included."""
    first = day_of(checked(since or FIRST, "--since"))
    last = day_of(checked(until or today(), "--until")) + 1.0
    if first >= last:
        raise WrongUse(
            f"audit: --since {since} is after --until {until or today()}, a period is needed; exchange the two"
        )
    return Scope(first, last, device, station, day_of(today()) + 1.0)


@dataclass(frozen=True)
class Audit:
    """The results of an audit.

    good : calibrations that belong to the unit of their serial; product : those that are not of a check standard
    period : those of the product in the scope
    problems : runs that cannot be used, with the reason; later : runs with a date of measurement after today
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
    charts: tuple[ControlChart, ...]
    yields: tuple[Share, ...]
    abilities: tuple[Ability, ...]
    differences: tuple[Difference, ...]
    odd: tuple[Odd, ...]
    studies: tuple[Study, ...]

    @property
    def overdue(self) -> Index:
        """Units that are overdue, as indices into ``due``."""
        return np.flatnonzero(self.due.day < self.scope.until)

    @property
    def coming_due(self) -> Index:
        """Units that come due within the days of notice, as indices into ``due``."""
        until = self.scope.until
        return np.flatnonzero((self.due.day >= until) & (self.due.day < until + self.rules.notice_days))


def audit(
    archive: Archive, rules: Rules, scope: Scope, *, distribute: Distributor | None = None, workers: int = 1
) -> Audit:
    """Audit the units, stations and population of an archive up to a day.

    Histories are analysed completely; ``since`` selects the changes, signals and figures that are reported.

    Parameters
    ----------
    distribute, workers : where runs are read, see :func:`pipelines.parallel.map_partitions`
    """
    index = up_to_date(archive, distribute, workers)
    every_run = dated_runs(index)
    runs = first_runs(index, every_run, scope.until)
    calibrations = load(index, runs)
    later = every_run[every_run["day"] >= scope.tomorrow].sort_values(["day", "run"])
    foreign = tuple(strangers(calibrations, rules))
    good = np.ones(len(calibrations), dtype=bool)
    good[[stranger.row for stranger in foreign]] = False
    product = ~np.array([rules.is_standard(str(unit)) for unit in calibrations.unit], dtype=bool)
    inside = product & _of_device(calibrations, scope) & _at(calibrations, scope)
    period = inside & (calibrations.day >= scope.since)
    figures = figures_of(index, calibrations, period)
    ledger = certificates_of(archive.root, scope.until, captures_of(every_run))
    kinds = kind_drifts(calibrations, good & inside, rules, scope.since)
    units = unit_drifts(calibrations, good & inside, kinds, rules, _limits(calibrations, figures))
    station = index.table("station").to_pandas().astype({"run": str})
    if scope.station:
        runs = runs[runs["station"] == scope.station]
    slots, means = slot_series(calibrations, good & product & _at(calibrations, scope))
    able, different = abilities(calibrations, figures)
    return Audit(
        scope=scope,
        rules=rules,
        all=calibrations,
        good=good,
        product=product,
        period=period,
        problems=tuple(left_out(every_run)),
        later=tuple(zip(later["run"], later["day"], strict=True)),
        strangers=tuple(stranger for stranger in foreign if calibrations.day[stranger.row] >= scope.since),
        kinds=tuple(kinds),
        units=units,
        due=last_measured(
            calibrations,
            due(calibrations, good & product & _of_device(calibrations, scope), rules, kinds, units, ledger),
            scope.station,
        ),
        certificates=ledger,
        stations=tuple(station_series(station, runs)),
        slots=tuple(slots),
        slot_means=tuple(means),
        charts=tuple(charts(calibrations.chosen(_at(calibrations, scope)), rules, scope.since)),
        yields=tuple(yields(calibrations, period)),
        abilities=tuple(able),
        differences=tuple(different),
        odd=tuple(odd_ones(calibrations, period)),
        studies=tuple(study for study in studies(calibrations, good & inside, rules) if study.last_day >= scope.since),
    )


def refuse_nothing(audited: Audit, root: str) -> None:
    """Refuse an unknown name, and an archive without calibrations before the day."""
    for switch, name, values in (
        ("--device", audited.scope.device.upper(), audited.all.device),
        ("--station", audited.scope.station, audited.all.station),
    ):
        if name and len(audited.all) and name not in values:
            known = [str(label) for label in np.unique(values.astype(str))]
            raise WrongUse(f"audit: {switch} '{name}' has no calibration in {root}; {did_you_mean(name, known)}")
    if not len(audited.all) and not audited.problems:
        raise WrongUse(
            f"audit: {root} has no calibration in this time, one at least is needed; make a run, or give another --until"
        )


def _of_device(calibrations: Calibrations, scope: Scope) -> Flags:
    return np.array([not scope.device or str(d) == scope.device.upper() for d in calibrations.device], dtype=bool)


def _at(calibrations: Calibrations, scope: Scope) -> Flags:
    return np.array([not scope.station or station == scope.station for station in calibrations.station], dtype=bool)


def _limits(calibrations: Calibrations, figures: Figures) -> dict[tuple[str, str], float]:
    """Limits of the product by device and family, from the decisions on these calibrations."""
    out: dict[tuple[str, str], float] = {}
    for family, (figure, factor) in LIMITED.items():
        rows = np.flatnonzero((figures.figure == figure) & np.isfinite(figures.limit))
        devices = calibrations.device[figures.row[rows]]
        for device in np.unique(devices.astype(str)):
            out[str(device), family] = factor * float(np.median(figures.limit[rows][devices == device]))
    return out
