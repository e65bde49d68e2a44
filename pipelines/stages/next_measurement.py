"""The next measurement as rows of a document: one per step, with what it decides, what it costs and what it brings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from inertial.criticism.classes import EffectClass
from inertial.criticism.proposals import Circumstances, Proposal, proposal
from inertial.errors import MissingInput

Proposed = list[tuple[EffectClass, Proposal | None]]
"""Classes of more than one effect, each with what parts it; None where nothing does."""

if TYPE_CHECKING:
    from inertial.criticism.diagnosis import Diagnosis
    from inertial.sequences import Step

BREAKER_POSE = (0.0, 0.0, 25.0)
"""Where a row says a breaker in words: any pose is as good, the words count."""


def next_measurements(proposed: Proposed) -> list[dict[str, Any]]:
    """Rows for every class that these data do not tell apart, in the order in which they are to be measured."""
    rows: list[dict[str, Any]] = []
    for group, found in proposed:
        rows += [_breaker(group)] if found is None else rows_of(found)
    return rows


def proposals(diagnosis: Diagnosis, around: Circumstances | None = None) -> Proposed:
    """For every class of more than one effect what parts it, measured after what parts those before it."""
    found: Proposed = []
    already: list[Step] = []
    for named in diagnosis.named:
        if len(named.effects.members) < 2:
            continue
        try:
            wanted = proposal(diagnosis.final, named.effects, around, already)
        except MissingInput:
            wanted = None
        if wanted is not None:
            already += wanted.steps
        found.append((named.effects, wanted))
    return found


def _breaker(group: EffectClass) -> dict[str, Any]:
    """What would part a class, in words, where no steps of the station do."""
    first, second = group.members[0].term.effect, group.members[1].term.effect
    outer, inner, temperature = BREAKER_POSE
    why = f"{first.id} | {second.id}: {second.breaker}"
    return {"outer_deg": outer, "inner_deg": inner, "chamber_C": temperature, "why": why}


def rows_of(found: Proposal) -> list[dict[str, Any]]:
    """Rows of one proposal: equal steps in a row are one, with their number."""
    rows: list[dict[str, Any]] = []
    for step, pair in zip(found.steps, found.pairs, strict=True):
        row = {
            "outer_deg": _degrees(step.outer),
            "inner_deg": _degrees(step.inner),
            "chamber_C": round(step.temperature, 2),
            "why": " | ".join(pair),
            "wait_s": round(step.wait, 1),
            "soaked": step.soaked,
        }
        if rows and {k: rows[-1][k] for k in row} == row:
            rows[-1]["repeats"] += 1
        else:
            rows.append({**row, "repeats": 1})
    whole = {
        "minutes": round(found.minutes, 1),
        "separation_before": round(found.before, 2),
        "separation_after": round(found.after, 2),
    }
    return [{**row, **whole} for row in rows]


def _degrees(angle: float) -> float:
    return round(float(np.degrees(angle)), 3) + 0.0
