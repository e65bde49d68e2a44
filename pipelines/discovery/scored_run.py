"""The scores of one run of an archive, in the form in which they are stored, so that no dwell is read again."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from inertial.arrays import Array
from inertial.discovery.scores import LotScores, scores_of
from inertial.errors import InertialError
from pipelines.archive import Archive, Run
from pipelines.stages.judge import shares_of, verdict_of
from pipelines.tables.sound_lot import every_unit_faulty, sound_lot
from schemas.errors import ArchiveUnusable, DataRejected, RecipeInvalid

LOGGER = logging.getLogger("tumbleline.discovery")


@dataclass(frozen=True)
class ScoredRun:
    """The scores of a run, with the quantities of :class:`inertial.discovery.scores.LotScores`.

    left_out : reason why it is not pooled, else empty · columns, of_station : columns of the sensor and of the station
    score, own : (units, m·k); information : (m·k,) · station_scores : (2, q), scores and information
    lot : (m·k, m·k), inside : (m, k, k), products of the columns · size : (m·k,), g · floor : g
    tempco : (units, m), g/K, temperature coefficients of the biases; nan without one
    """

    run: str
    when: str
    station: str
    device: str
    model: str
    who: str
    left_out: str
    units: tuple[str, ...] = ()
    slots: tuple[str, ...] = ()
    columns: tuple[tuple[str, int], ...] = ()
    of_station: tuple[tuple[str, int], ...] = ()
    score: Array | None = None
    own: Array | None = None
    information: Array | None = None
    station_scores: Array | None = None
    lot: Array | None = None
    inside: Array | None = None
    size: Array | None = None
    tempco: Array | None = None
    floor: float = 0.0


def scored_runs(part: tuple[str, Sequence[str]]) -> list[ScoredRun]:
    """The scores of runs of an archive, or the reason why a run is not pooled; a damaged run is omitted, and tried again later.

    Parameters
    ----------
    part : address of the archive, and ids of its runs
    """
    (address, ids), out = part, list[ScoredRun]()
    archive = Archive(address)
    with threadpool_limits(1):
        for run_id in ids:
            try:
                out.append(_scored(Run(archive, run_id)))
            except ArchiveUnusable as problem:
                LOGGER.warning("discover: run %s is not pooled: %s", run_id, problem)
    return out


def _scored(run: Run) -> ScoredRun:
    about = run.about
    effects = list((about.get("recipe") or {}).get("effects") or [])
    lot_of_run = about.get("lot") or {}
    slots = {str(unit["serial"]): str(unit.get("slot", "")) for unit in lot_of_run.get("units", [])}
    head: dict[str, Any] = {
        "run": run.id,
        "when": str(about.get("measured") or about["when"]),
        "station": str((about.get("station") or {}).get("name", "")),
        "device": str(lot_of_run.get("device", "")),
        "model": ",".join(effects),
        "who": str(about.get("who", "")),
    }
    try:
        verdict = run.table("verdict") if (run.path / "verdict.parquet").is_file() else None
        reason = _reason(run, effects, verdict)
        if reason:
            return ScoredRun(**head, left_out=reason)
        has_history = (run.path / "history.parquet").is_file()
        measurement, faults, lot = sound_lot(
            run.table("dwells"), run.table("history") if has_history else None, effects
        )
        if lot is None:
            return ScoredRun(**head, left_out=every_unit_faulty(faults))
        if lot.radial:
            return ScoredRun(**head, left_out="its poses are not known")
        if len(lot.state.axes) < 3:
            return ScoredRun(**head, left_out="its devices have fewer than three axes")
        faulty = {fault.unit for fault in faults}
        units = tuple(unit for row, unit in enumerate(measurement.units) if row not in faulty)
        shares = None if verdict is None else shares_of(verdict)
        return _scored_lot(head, units, slots, scores_of(lot, effects, shares=shares))
    except (InertialError, DataRejected, RecipeInvalid) as problem:
        return ScoredRun(**head, left_out=str(problem).rstrip("."))


def _reason(run: Run, effects: Sequence[str], verdict: pd.DataFrame | None) -> str:
    """The reason why a run is not scored, else empty."""
    if not effects:
        return "it has no model; 'tumbleline fit' makes a run with one"
    if not (run.path / "dwells.parquet").is_file():
        return "it has no dwells"
    judged = None if verdict is None else verdict_of(verdict)
    if judged is not None and judged["adequate"] is False:
        return "its model is not adequate; see 'tumbleline diagnose'"
    return ""


def _scored_lot(head: dict[str, Any], units: tuple[str, ...], slots: dict[str, str], scores: LotScores) -> ScoredRun:
    count = len(units)
    return ScoredRun(
        **head,
        left_out="",
        units=units,
        slots=tuple(slots.get(unit, "") for unit in units),
        columns=scores.columns,
        of_station=scores.station,
        score=scores.score.reshape(count, -1),
        own=scores.own.reshape(count, -1),
        information=np.diagonal(scores.lot).copy(),
        station_scores=np.stack([scores.station_score, scores.station_information]),
        lot=scores.lot,
        inside=scores.inside,
        size=scores.size.reshape(-1),
        tempco=scores.tempco,
        floor=scores.floor,
    )
