"""The next measurement as rows of a document: one per step, with purpose, station time and expected separation."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from inertial import effects as catalogue
from inertial.criticism.classes import EffectClass
from inertial.criticism.diagnosis import Diagnosis
from inertial.errors import MissingInput
from inertial.next_measurement.proposals import Circumstances, Proposal, proposal, sighting, twins
from inertial.planning.sequences import SequenceStep

BREAKER_POSE = (0.0, 0.0, 25.0)
"""Pose of a row without steps (``measurable`` is false): its text states what is needed."""


@dataclass(frozen=True)
class Proposed:
    """What to measure next, in order: steps that separate classes of several effects, then steps that show unseen effects.

    parting : classes, each with None if no steps of the station are certain to separate it
    twins : per class, the members that no measurement of the station separates from its best one, and that one
    showing : None if no unseen effect matters, or the station cannot show any
    """

    parting: tuple[tuple[EffectClass, Proposal | None], ...] = ()
    showing: Proposal | None = None
    twins: tuple[tuple[str, ...], ...] = ()

    @property
    def separating(self) -> tuple[Proposal, ...]:
        """The proposals that separate classes."""
        return tuple(p for _, p in self.parting if p is not None)

    def rows(self) -> list[dict[str, Any]]:
        """All proposals as rows, in order of measurement."""
        rows: list[dict[str, Any]] = []
        twins = [*self.twins, *[()] * (len(self.parting) - len(self.twins))]
        for (group, measurement), alike in zip(self.parting, twins, strict=True):
            rows += rows_of(measurement) if measurement is not None else [] if alike else [_breaker(group)]
            rows += [_no_measurement(alike)] if alike else []
        return rows if self.showing is None else [*rows, *rows_of(self.showing)]


def proposed(diagnosis: Diagnosis, around: Circumstances | None = None) -> Proposed:
    """The next measurements after a diagnosis, each one planned after the ones before.

    Parameters
    ----------
    around : capabilities of the station; those that the run shows if None
    """
    parting: list[tuple[EffectClass, Proposal | None]] = []
    already: list[SequenceStep] = []
    twin: list[tuple[str, ...]] = []
    for named in (*diagnosis.handled, *diagnosis.named):
        if len(named.effects.members) > 1:
            # more poses do not separate handling errors from effects; the text of the handling error says what does
            measurement, alike = None, ()
            if not named.effects.of_data:
                with suppress(MissingInput):  # a quantity that the run did not record
                    measurement = proposal(diagnosis.final, named.effects, around, already)
                with suppress(MissingInput):
                    alike = twins(diagnosis.final, named.effects, around)
            already += measurement.steps if measurement is not None else ()
            parting.append((named.effects, measurement))
            twin.append(alike)
    return Proposed(tuple(parting), sighting(diagnosis.final, diagnosis.unseen, around, already), tuple(twin))


def _breaker(group: EffectClass) -> dict[str, Any]:
    """What separates a class, as text, if no steps of the station do."""
    ordered = sorted(group.members[:2], key=lambda m: m.term.effect.scope == "data")
    first, second = (m.term.effect for m in ordered)
    steps = "" if group.of_data else "no steps of the station are certain to separate them; needed:  "
    why = f"{first.id} | {second.id}: {steps}{second.breaker}"
    return _without_steps(why)


def _no_measurement(alike: Sequence[str]) -> dict[str, Any]:
    """What separates effects that are identical under every step of the station, as text."""
    cures = dict.fromkeys(catalogue.get(name).breaker for name in alike)
    why = f"{' | '.join(alike)}: no measurement of this station separates them; needed: {'; '.join(cures)}"
    return _without_steps(why)


def _without_steps(why: str) -> dict[str, Any]:
    outer, inner, temperature = BREAKER_POSE
    return {"outer_deg": outer, "inner_deg": inner, "chamber_C": temperature, "why": why, "measurable": False}


def rows_of(suggestion: Proposal) -> list[dict[str, Any]]:
    """Rows of one proposal: consecutive equal steps are one row with their number."""
    rows: list[dict[str, Any]] = []
    before: dict[str, Any] | None = None
    about = " | ".join(suggestion.pair) or f"not seen so far: {', '.join(suggestion.ids)}"
    for step in suggestion.steps:
        row = {
            "outer_deg": _degrees(step.outer),
            "inner_deg": _degrees(step.inner),
            "chamber_C": round(step.temperature, 2),
            "why": about,
            "wait_s": round(step.wait, 1),
            "soaked": step.soaked,
            **({"off_s": round(step.off, 1)} if step.off > 0.0 else {}),
        }
        if row == before:
            rows[-1]["repeats"] += 1
        else:
            rows.append({**row, "repeats": 1})
        before = row
    whole = {
        "minutes": round(suggestion.minutes, 1),
        "separation_before": round(suggestion.before, 2),
        "separation_after": round(suggestion.after, 2),
        **({"separation_if": {name: round(chi, 2) for name, chi in suggestion.if_true}} if suggestion.if_true else {}),
        **({"not_parted": list(suggestion.remaining)} if suggestion.remaining else {}),
    }
    return [{**row, **whole} for row in rows]


def _degrees(angle: float) -> float:
    return round(float(np.degrees(angle)), 3) + 0.0
