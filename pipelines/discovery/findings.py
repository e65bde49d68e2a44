"""The document of an evaluation: discoveries, evidence that is held back, and what the archive could have shown."""

from collections import Counter

import numpy as np
from scipy import stats

from inertial.counts import number_of
from inertial.discovery.evidence import MEAN
from inertial.discovery.running_sums import FIRST
from pipelines.discovery.discoveries import Discoveries, plain
from pipelines.discovery.documents import (
    DiscoverDocument,
    DiscoveryRow,
    DriverRow,
    HeldAlarm,
    ReachRow,
    UnexplainedRow,
    UntoldEffect,
)
from pipelines.discovery.evidence_state import ALPHA, Evidences
from pipelines.discovery.lot_source import DiscoveryArchive
from schemas.units import MICRO

_SOME = 50


def document_of(
    found: Discoveries,
    before: tuple[list[DiscoveryRow], list[UnexplainedRow]] | None = None,
    *,
    looking_back: bool = False,
) -> DiscoverDocument:
    """The findings as a document.

    Parameters
    ----------
    before : discoveries and unexplained dependences of an earlier night with the same alarms, to be reused
    """
    state, source = found.state, found.source
    heads = [source.store.heads[run] for run in state.order]
    days = [source.day_of(run) for run in state.order]
    rows, unexplained = found.rows() if before is None else before
    if before is None:
        for number, row in enumerate((*rows, *unexplained), start=1):
            row["id"] = f"D{number}"
    reach, unseen = _visible(found)
    return {
        "pooled": {
            "lots": len(state.order),
            "units": sum(len(head["units"]) for head in heads),
            "left_out": [{"run": run, "reason": reason} for run, reason in source.left_out()],
            "from": min(days, default=None),
            "until": max(days, default=None),
        },
        "model": [name for head in heads[-1:] for name in head["model"].split(",") if name],
        "device": source.device,
        "error_control": {
            "alpha": ALPHA,
            "hypotheses": len(state.sensor.drivers) * state.sensor.size,
            "log_e_needed": round(state.least_needed(), 2) if state.sensor.count else None,
            "valid": "every night",
        },
        "discoveries": rows,
        "held": _held(state),
        "unexplained": unexplained,
        "population": [],
        "reach": reach,
        "unseen": unseen,
        "drivers": _drivers(source, state),
        "warnings": _warnings(source, state),
        "compared": [],
        "new": [],
        "looking_back": looking_back,
    }


def _held(state: Evidences) -> list[HeldAlarm]:
    reason = "it is constant within each lot, and stations differ or wander in this effect"
    if len(state.sensor.wander.stations) < 2:
        reason = "with one station it may be an error of the station's references"
    rows: list[HeldAlarm] = []
    for alarm in state.judged(held=True):
        effect, _, axis = state.hypotheses[alarm.index]
        log_e = round(float(state.log_e(alarm.driver)[alarm.index]), 2)
        rows.append({"effect": effect, "axis": axis, "driver": alarm.driver, "log_e": log_e, "reason": reason})
    return sorted(rows, key=lambda row: -row["log_e"])


def _visible(found: Discoveries) -> tuple[list[ReachRow], list[UntoldEffect]]:
    """The smallest size of each effect that this archive would have shown in 95 % of cases; effects that no lot shows."""
    sensor, lots, pool = found.state.sensor, len(found.state.order), found.source.pool
    if lots < FIRST:
        return [], []
    some = found.some(_SOME)  # for quantities that are similar in all lots
    inside = np.mean([lot.own.sum(axis=0) for lot, _ in some], axis=0) * lots
    between, within = sensor.noise
    times = np.sqrt(2.0 * (found.state.least_needed() + 0.5 * np.log1p(0.03 * lots))) + stats.norm.ppf(0.95)
    rows: list[ReachRow] = []
    for driver, information, noise in ((MEAN, sensor.information, between), ("inside lots", inside, within)):
        seen = information > 0.0
        sizes = np.where(seen, times * noise / np.sqrt(np.where(seen, information, 1.0)) * pool.size, np.nan)
        for effect in pool.effects:
            of_effect = sizes[pool.everywhere(effect)]
            visible = of_effect[np.isfinite(of_effect) & (of_effect > 0.0)]
            if visible.size:
                smallest = MICRO * float(np.median(visible))
                needed = max(FIRST, int(np.ceil(lots * smallest**2)))
                rows.append({"effect": effect, "driver": driver, "smallest_ug": smallest, "lots_to_1_ug": needed})
    alone, nowhere = "errors of the station have the same columns", "no lot excites it"
    places = {effect: pool.everywhere(effect) for effect in pool.effects}
    unseen: list[UntoldEffect] = [
        {"effect": effect, "reason": alone if inside[at].any() else nowhere}
        for effect, at in places.items()
        if not sensor.information[at].any()
    ]
    return rows, unseen


def _drivers(source: DiscoveryArchive, state: Evidences) -> list[DriverRow]:
    judged = list(dict.fromkeys(map(plain, state.sensor.drivers)))
    rows: list[DriverRow] = [{"name": name, "status": "judged"} for name in judged]
    for name in source.attributes.names():
        if name not in judged:
            status = "one level" if len(set(source.attributes.values(name))) < 2 else "no unit of a pooled lot has it"
            rows.append({"name": name, "status": status})
    return rows


def _warnings(source: DiscoveryArchive, state: Evidences) -> list[str]:
    out: list[str] = []
    lots = len(state.order)
    reasons = Counter(reason for _, reason in source.left_out())
    if not lots and reasons:
        counted = "; ".join(f"{reason} ({number_of(count, 'run')})" for reason, count in reasons.most_common())
        out.append(f"no lot can be used: {counted}")
    elif lots < FIRST:
        out.append(
            f"{number_of(lots, 'lot')}: a discovery needs at least {FIRST}, one that follows an attribute about 60"
        )
    for device, count in source.other_devices.items():
        out.append(f"not pooled with {source.device}: {number_of(count, 'run')} of {device}; add --device {device}")
    if state.taken_out:
        out.append(f"{number_of(len(state.taken_out), 'run')} taken out, because a calibration was revoked")
    if len(state.sensor.wander.stations) == 1 and lots:
        out.append(
            "one station: effects that are constant within a lot may be its wander; measure units on two stations"
        )
    return out
