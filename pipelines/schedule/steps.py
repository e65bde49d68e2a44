"""The steps of a capture: every record of a recipe, in order."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from pipelines.procedures import PROCEDURES, ProcedureStep, parts_of
from schemas.poses import Pose
from schemas.recipe import Recipe

Kind = Literal["dwell", "verification", "allan", "procedure"]


@dataclass(frozen=True)
class Step:
    """One record to take: its number, what it is for, the soak that it belongs to, and the pose.

    wait_s : after the move; the recipe's where None
    off_s : without power before the move
    settled : whether the devices settle at the soak's temperature first, or are read while they follow the chamber
    procedure : number in the recipe's list of procedures, from 0; None where the recipe has no list
    lasting_s, rate_hz : of the record; the recipe's where None
    order : the step of the procedure, for records that its equipment performs
    """

    record: int
    kind: Kind
    soak: int
    temperature: float
    pose: Pose
    wait_s: float | None = None
    settled: bool = True
    off_s: float = 0.0
    procedure: int | None = None
    lasting_s: float | None = None
    rate_hz: float | None = None
    order: ProcedureStep | None = None

    def lasts(self, recipe: Recipe) -> float:
        """Duration of the record, s."""
        if self.lasting_s is not None:
            return self.lasting_s
        return recipe.static_record_s if self.kind == "allan" else recipe.dwell_s


def steps(recipe: Recipe) -> list[Step]:
    """Every record of a recipe in order: per temperature the poses, then those for verification; the static record last.

    With ``verification_order = "interleaved"`` those for verification are spread evenly among the poses of their soak.

    The static record has a soak of its own, unless it is taken at the last temperature.
    """
    if recipe.procedures:
        return _listed(recipe)
    records: list[Step] = []
    for soak, temperature in enumerate(recipe.temperatures_C):
        first = len(records)
        poses, waits, settled = recipe.poses_at(soak), recipe.waits_at(soak), recipe.settles_at(soak)
        for pose, wait, off in zip(poses, waits, recipe.off_at(soak), strict=True):
            records.append(Step(len(records), "dwell", soak, temperature, pose, wait, settled, off))
        for pose in recipe.verification_at(soak):
            records.append(Step(len(records), "verification", soak, temperature, pose, settled=settled))
        if recipe.verification_order == "interleaved":
            records = [*records[:first], *_interleaved(records[first:], first)]
    if recipe.static_record_s > 0.0:
        again = recipe.static_temperature_C == recipe.temperatures_C[-1]
        soak = len(recipe.temperatures_C) - (1 if again else 0)
        records.append(Step(len(records), "allan", soak, recipe.static_temperature_C, recipe.static_pose))
    return records


def _interleaved(soak: list[Step], first: int) -> list[Step]:
    """The records of a soak with those for verification spread among the others, numbered anew from ``first``."""
    checks = [step for step in soak if step.kind == "verification"]
    others = [step for step in soak if step.kind != "verification"]
    places = [(k + 0.5) / len(others) for k in range(len(others))] + [
        (k + 0.5) / len(checks) for k in range(len(checks))
    ]
    order = sorted(range(len(soak)), key=lambda k: (places[k], k))
    every = [*others, *checks]
    return [replace(every[k], record=first + n) for n, k in enumerate(order)]


def _listed(recipe: Recipe) -> list[Step]:
    """Every record of a recipe's list of procedures; a procedure at the temperature of the one before shares its soak."""
    records: list[Step] = []
    for number, part in enumerate(parts_of(recipe)):
        own = PROCEDURES[part.kind].steps(part, recipe)
        same = bool(records and own) and records[-1].temperature == own[0].temperature_C and own[0].settled
        first = (records[-1].soak + (0 if same else 1)) if records else 0
        for one in own:
            records.append(
                Step(
                    len(records),
                    one.kind,
                    first + one.soak - own[0].soak,
                    one.temperature_C,
                    one.pose,
                    one.wait_s,
                    one.settled,
                    one.off_s,
                    number,
                    one.lasting_s,
                    one.rate_hz,
                    one,
                )
            )
    return records
