"""The steps of a capture: every record of a recipe, in order."""

from dataclasses import dataclass
from typing import Literal

from pipelines.procedures import PROCEDURES, Part, ProcedureStep, parts_of
from pipelines.procedures.recorded import Turn
from schemas.poses import Pose
from schemas.recipe import Recipe

Kind = Literal["dwell", "verification", "allan", "procedure"]
TUMBLED = ("dwell", "verification")
AS_STATED = ("kind", "pose", "wait_s", "settled", "off_s", "lasting_s", "rate_hz")
"""What a step has from the step of its procedure as it is."""


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

    @property
    def turns(self) -> tuple[Turn, ...]:
        """The turns of the table during the record."""
        return self.order.turns if self.order is not None else ()

    def lasts(self, recipe: Recipe) -> float:
        """Duration of the record, s."""
        if self.lasting_s is not None:
            return self.lasting_s
        return recipe.static_record_s if self.kind == "allan" else recipe.dwell_s


def steps(recipe: Recipe) -> list[Step]:
    """Every record of a recipe in order: of its procedures, or without a list of the multi-position test and the static record.

    A procedure at the temperature of the procedure before shares its soak.
    """
    listed: list[tuple[str, Part | None]] = [(part.kind, part) for part in parts_of(recipe)]
    if not listed:
        listed = [("multi_position", None), *([("static_record", None)] if recipe.static_record_s > 0.0 else [])]
    records: list[Step] = []
    for number, (kind, part) in enumerate(listed):
        orders = PROCEDURES[kind].steps(part, recipe)
        same = bool(records and orders) and records[-1].temperature == orders[0].temperature_C and orders[0].settled
        first = (records[-1].soak + (0 if same else 1)) if records else 0
        for order in orders:
            step = Step(
                record=len(records),
                soak=first + order.soak - orders[0].soak,
                temperature=order.temperature_C,
                procedure=number if recipe.procedures else None,
                order=order if recipe.procedures else None,
                **{name: getattr(order, name) for name in AS_STATED},
            )
            records.append(step)
    return records
