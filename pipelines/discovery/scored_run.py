"""The scores of one run of an archive, or the reason why it is not pooled, so that no dwell is read again."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b

import pandas as pd
from threadpoolctl import threadpool_limits

from inertial.discovery.scores import LotScores, scores_of
from inertial.errors import InertialError
from pipelines.archive import Archive, Run
from pipelines.stages.judge import shares_of, verdict_of
from pipelines.tables.sound_lot import every_unit_faulty, sound_lot
from schemas.errors import ArchiveUnusable, DataRejected, RecipeInvalid

LOGGER = logging.getLogger("tumbleline.discovery")


@dataclass(frozen=True)
class ScoredRun:
    """A run with its scores.

    left_out : reason why it has none and is not pooled, else empty · units, slots : in the order of the scores
    prints : a number for each unit, the same in another run of the same dwells
    """

    run: str
    when: str
    station: str
    device: str
    model: str
    who: str
    left_out: str = ""
    units: tuple[str, ...] = ()
    slots: tuple[str, ...] = ()
    prints: tuple[int, ...] = ()
    scores: LotScores | None = None


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
    head = ScoredRun(
        run=run.id,
        when=str(about.get("measured") or about["when"]),
        station=str((about.get("station") or {}).get("name", "")),
        device=str(lot_of_run.get("device", "")),
        model=",".join(effects),
        who=str(about.get("who", "")),
    )
    try:
        verdict = run.table("verdict") if (run.path / "verdict.parquet").is_file() else None
        reason = _reason(run, effects, verdict)
        if reason:
            return replace(head, left_out=reason)
        has_history = (run.path / "history.parquet").is_file()
        dwells = run.table("dwells")
        measurement, faults, lot = sound_lot(dwells, run.table("history") if has_history else None, effects)
        if lot is None:
            return replace(head, left_out=every_unit_faulty(faults))
        if lot.radial:
            return replace(head, left_out="its poses are not known")
        if len(lot.state.axes) < 3:
            return replace(head, left_out="its devices have fewer than three axes")
        faulty = {fault.unit for fault in faults}
        units = tuple(unit for row, unit in enumerate(measurement.units) if row not in faulty)
        slots = {str(unit["serial"]): str(unit.get("slot", "")) for unit in lot_of_run.get("units", [])}
        scores = scores_of(lot, effects, shares=None if verdict is None else shares_of(verdict))
        of_units = tuple(slots.get(unit, "") for unit in units)
        return replace(head, units=units, slots=of_units, prints=_prints(dwells, units), scores=scores)
    except (InertialError, DataRejected, RecipeInvalid) as problem:
        return replace(head, left_out=str(problem).rstrip("."))


def _prints(dwells: pd.DataFrame, units: Sequence[str]) -> tuple[int, ...]:
    """A number for each unit from its outputs, to single precision: no other measurement has the same noise."""
    of_unit = dict(list(dwells[["out_x", "out_y", "out_z"]].astype("float32").groupby(dwells["unit"].astype(str))))
    hashes = (blake2b(of_unit[unit].to_numpy().tobytes(), digest_size=8).digest() for unit in units)
    return tuple(int.from_bytes(print_, "little", signed=True) for print_ in hashes)


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
