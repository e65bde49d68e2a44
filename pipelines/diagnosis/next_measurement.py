"""The next measurement: rows of a document with purpose, station time and expected separation, and a recipe with its steps."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError

from inertial import effects as catalogue
from inertial.criticism.classes import EffectClass
from inertial.criticism.diagnosis import Diagnosis
from inertial.errors import MissingInput
from inertial.next_measurement.proposals import Circumstances, Proposal, proposal, sighting, twins
from inertial.planning.sequences import SequenceStep
from pipelines.diagnosis.documents import NextMeasurement
from pipelines.diagnosis.sentences import UNSEEN
from schemas.poses import Pose, SoakPart
from schemas.recipe import Recipe
from schemas.toml_files import explain

BREAKER_POSE = (0.0, 0.0, 25.0)
"""Pose of a row without steps (``measurable`` is false): its text states what is needed."""


@dataclass(frozen=True)
class Proposed:
    """The next measurements, in order: steps that separate classes of several effects, then steps that show unseen effects.

    parting : classes, each with its proposal, or None if no steps of the station reliably separate it
    twins : per class, ids of its best member and of members that no measurement of the station separates from it
    showing : proposal for unseen effects; None if none can exceed the noise, or if the station cannot show any
    """

    parting: tuple[tuple[EffectClass, Proposal | None], ...] = ()
    showing: Proposal | None = None
    twins: tuple[tuple[str, ...], ...] = ()

    @property
    def separating(self) -> tuple[Proposal, ...]:
        """The proposals that separate classes."""
        return tuple(p for _, p in self.parting if p is not None)

    def rows(self) -> list[NextMeasurement]:
        """All proposals as rows, in order of measurement."""
        rows: list[NextMeasurement] = []
        twins = [*self.twins, *[()] * (len(self.parting) - len(self.twins))]
        for (group, measurement), twin_ids in zip(self.parting, twins, strict=True):
            rows += rows_of(measurement) if measurement is not None else [] if twin_ids else [_breaker(group)]
            if twin_ids:  # what separates effects that are identical under every step of the station
                needed = "; ".join(dict.fromkeys(catalogue.get(name).breaker for name in twin_ids))
                why = f"{' | '.join(twin_ids)}: no measurement of this station separates them; needed: {needed}"
                rows.append(_without_steps(why))
        return rows if self.showing is None else [*rows, *rows_of(self.showing)]


def proposed(diagnosis: Diagnosis, around: Circumstances | None = None) -> Proposed:
    """The next measurements after a diagnosis, each planned to follow those before it.

    Parameters
    ----------
    around : capabilities of the station; those that the run implies if None
    """
    parting: list[tuple[EffectClass, Proposal | None]] = []
    already: list[SequenceStep] = []
    twin: list[tuple[str, ...]] = []
    for named in (*diagnosis.handled, *diagnosis.named):
        if len(named.effects.members) > 1:
            # more poses do not separate handling errors from effects; the handling error's ``breaker`` says what does
            measurement, twin_ids = None, ()
            if not named.effects.of_data:
                with suppress(MissingInput):  # a quantity that the run did not record
                    measurement = proposal(diagnosis.final, named.effects, around, already)
                with suppress(MissingInput):
                    twin_ids = twins(diagnosis.final, named.effects, around)
            already += measurement.steps if measurement is not None else ()
            parting.append((named.effects, measurement))
            twin.append(twin_ids)
    return Proposed(tuple(parting), sighting(diagnosis.final, diagnosis.unseen, around, already), tuple(twin))


def _breaker(group: EffectClass) -> NextMeasurement:
    """A row without steps, for a class that no steps of the station separate: it states what would."""
    ordered = sorted(group.members[:2], key=lambda m: m.term.effect.scope == "data")
    first, second = (m.term.effect for m in ordered)
    steps = "" if group.of_data else "no steps of the station are certain to separate them; needed: "
    why = f"{first.id} | {second.id}: {steps}{second.breaker}"
    return _without_steps(why)


def _without_steps(why: str) -> NextMeasurement:
    outer, inner, temperature = BREAKER_POSE
    return {"outer_deg": outer, "inner_deg": inner, "chamber_C": temperature, "why": why, "measurable": False}


def rows_of(suggestion: Proposal) -> list[NextMeasurement]:
    """Rows of one proposal; consecutive equal steps are one row with the number of repeats."""
    rows: list[NextMeasurement] = []
    before: NextMeasurement | None = None
    about = " | ".join(suggestion.pair) or f"{UNSEEN}{', '.join(suggestion.ids)}"
    for step in suggestion.steps:
        row: NextMeasurement = {
            "outer_deg": _degrees(step.outer),
            "inner_deg": _degrees(step.inner),
            "chamber_C": round(step.temperature, 2),
            "why": about,
            "wait_s": round(step.wait, 1),
            "soaked": step.soaked,
        }
        if step.off > 0.0:
            row["off_s"] = round(step.off, 1)
        if row == before:
            rows[-1]["repeats"] = rows[-1].get("repeats", 1) + 1
        else:
            rows.append({**row, "repeats": 1})
        before = row
    for row in rows:
        row["minutes"] = round(suggestion.minutes, 1)
        row["separation_before"], row["separation_after"] = round(suggestion.before, 2), round(suggestion.after, 2)
        if suggestion.if_true:
            row["separation_if"] = {name: round(chi, 2) for name, chi in suggestion.if_true}
        if suggestion.remaining:
            row["not_parted"] = list(suggestion.remaining)
    return rows


def _degrees(angle: float) -> float:
    return round(float(np.degrees(angle)), 3) + 0.0


SAME_SOAK_K = 0.5
"""Steps whose chamber temperature differs by less from the soak before them are part of that soak."""


def next_recipe(base: Recipe, rows: Sequence[NextMeasurement], name: str) -> Recipe:
    """The recipe ``base`` with the proposed steps appended; its model is that of ``base``.

    The steps of ``base`` are measured again, because the proposed ones alone have too few poses for a fit, and their expected χ²
    includes the earlier dwells. A recipe file has no formulas: those of a model file are left out.

    Parameters
    ----------
    rows : ``next_measurements`` of a diagnosis; rows that are not measurable are left out
    name : name of the new recipe

    Raises
    ------
    RecipeInvalid
        The steps do not fit the recipe, such as an angle that no recipe can have.
    """
    poses = [*base.poses]
    numbers = {(pose.outer_deg, pose.inner_deg): k for k, pose in reversed([*enumerate(poses, start=1)])}
    soaks = [_explicit(base, k) for k in range(len(base.temperatures_C))]
    for row in (row for row in rows if row.get("measurable", True)):
        angles = (row["outer_deg"], row["inner_deg"])
        if angles not in numbers:
            poses.append(Pose(name=f"n{len(poses) + 1:03d}", outer_deg=angles[0], inner_deg=angles[1]))
            numbers[angles] = len(poses)
        part = _soak_for(soaks, row)
        for _ in range(row.get("repeats", 1)):
            part["poses"].append(numbers[angles])
            part["waits_s"].append(row.get("wait_s", base.settle_s))
            part["off_s"].append(row.get("off_s", 0.0))
    changes = {
        "name": re.sub(r"[^a-z0-9._-]+", "-", name.lower()).strip("-._") or "next",
        "description": f"{base.name} and the steps that a diagnosis proposes",
        "poses": [pose.model_dump() for pose in poses],
        "soaks": [_tidied(part, base) for part in soaks],
        "temperatures_C": [part["temperature_C"] for part in soaks],
        "effects": [name for name in base.effects if name not in {formula.id for formula in base.formulas}],
        "formulas": [],
        "model_name": "",
        "model_version": 0,
    }
    try:
        return Recipe.model_validate({**base.model_dump(), **changes})
    except ValidationError as problem:
        raise explain(problem, f"recipe {changes['name']}", Recipe) from None


def reasons(rows: Sequence[NextMeasurement]) -> list[str]:
    """The purposes of the proposed steps, once each; empty without steps."""
    return list(dict.fromkeys(row["why"] for row in rows if row.get("measurable", True)))


def _explicit(base: Recipe, soak: int) -> dict[str, Any]:
    """A soak of the recipe with its poses listed by number, because "all poses" would include the added ones."""
    given = base.soaks[soak] if base.soaks else SoakPart(temperature_C=base.temperatures_C[soak])
    listed = given.poses if given.poses is not None else range(1, len(base.poses) + 1)
    return {
        **given.model_dump(),
        "poses": list(listed),
        "waits_s": list(base.waits_at(soak)),
        "off_s": list(base.off_at(soak)),
    }


def _soak_for(soaks: list[dict[str, Any]], row: NextMeasurement) -> dict[str, Any]:
    """The soak that a step is measured in: the last soak at its temperature, else a new soak."""
    temperature = float(row["chamber_C"])
    if abs(soaks[-1]["temperature_C"] - temperature) >= SAME_SOAK_K:
        soaks.append(
            {
                "temperature_C": temperature,
                "poses": [],
                "verification": [],
                "waits_s": [],
                "off_s": [],
                "settled": row.get("soaked", True),
            }
        )
    return soaks[-1]


def _tidied(part: dict[str, Any], base: Recipe) -> dict[str, Any]:
    """A soak without ``waits_s`` and ``off_s`` if these equal the defaults of the recipe ``base``."""
    tidied = dict(part)
    if all(wait == base.settle_s for wait in part["waits_s"]):
        tidied["waits_s"] = None
    if not any(part["off_s"]):
        tidied["off_s"] = None
    return tidied
