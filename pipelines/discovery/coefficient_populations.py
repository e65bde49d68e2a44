"""Findings on the coefficients of many units: coefficients with two populations, and correlated pairs."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from inertial.discovery.correlations import Correlations
from inertial.discovery.populations import two_populations
from pipelines.archive import Archive, Run
from pipelines.audit.calibrations import dated_runs, first_runs, load
from pipelines.audit.index import up_to_date
from pipelines.audit.parameters import FAMILIES, FAMILY_OF, NAMES, unit_text
from pipelines.discovery.documents import PopulationRow
from pipelines.discovery.evidence_state import ALPHA
from pipelines.tables.calibration import Calibration, column_names, read_calibration
from schemas.errors import TumblelineError
from schemas.units import AXES

_SEED = 20


def populations(archive: Archive, device: str, workers: int = 1) -> list[PopulationRow]:
    """Coefficients with two populations of units, and correlated pairs; each unit counts once, by its first calibration."""
    index = up_to_date(archive, workers=workers)
    runs = first_runs(index, dated_runs(index), np.inf)
    calibrations = load(index, runs)
    of_kind = calibrations.chosen(calibrations.device.astype(str) == device)
    order = np.argsort(of_kind.day, kind="stable")
    first = of_kind.chosen(order[np.unique(of_kind.unit[order].astype(str), return_index=True)[1]])
    judged = [name for name in NAMES if FAMILIES[FAMILY_OF[name]].of_unit]
    needed = float(np.log(len(judged) / ALPHA))
    rows: list[PopulationRow] = []
    for name in judged:
        found = two_populations(first.column(name), np.random.default_rng(_SEED))
        if found is None or found.log_e < needed:
            continue
        detail = {"means": list(found.means), "widths": list(found.widths), "share": found.share}
        detail |= {"unit": unit_text(name), "units": len(first)}
        rows.append({"figure": name, "kind": "two_populations", "log_e": round(found.log_e, 2), "detail": detail})
    of_device = runs.loc[runs["device"] == device].sort_values("day", kind="stable")
    return [*rows, *correlations(_first_calibrations(archive, of_device["run"].tolist()))]


def _first_calibrations(archive: Archive, runs: list[str]) -> Iterator[Calibration]:
    """The calibrations of runs, each unit once; runs with unreadable files are skipped (``verify`` reports them)."""
    seen: set[str] = set()
    for name in runs:
        run = Run(archive, name)
        try:
            made = read_calibration(run.table("coefficients"), run.table("covariance"))
        except TumblelineError:
            continue
        new = [row for row, unit in enumerate(made.units) if unit not in seen]
        seen |= set(made.units)
        if new:
            values, covariance = made.coefficients[new], made.covariance[new]
            units = tuple(made.units[row] for row in new)
            yield replace(made, units=units, coefficients=values, covariance=covariance)


def correlations(calibrations: Iterable[Calibration]) -> list[PopulationRow]:
    """Correlated pairs of coefficients, for each model with enough lots."""
    of_model: dict[tuple[tuple[str, ...], tuple[int, ...]], Correlations] = {}
    for made in calibrations:
        sums = of_model.setdefault((made.effects, made.axes), Correlations())
        if not made.nonlinear:  # with fitted nonlinear parameters the meaning of a coefficient differs between lots
            sums.add(made.coefficients, made.covariance)
    rows: list[PopulationRow] = []
    for (model, axes), sums in of_model.items():
        names = column_names(model, {}, axes)
        for pair in sums.found(ALPHA / len(of_model)):
            first, second = (" ".join(names[pair.axis][column]) for column in (pair.first, pair.second))
            axis = AXES[axes[pair.axis]]
            detail = {"with": f"{second} {axis}", "correlation": pair.value, "u": pair.error, "units": sums.units}
            rows.append(
                {"figure": f"{first} {axis}", "kind": "correlation", "log_e": round(pair.log_e, 2), "detail": detail}
            )
    return rows
