"""The static record: hours in one pose, whose noise the stage of the chain analyses."""

from typing import Any, Literal

from pipelines.procedures.base import Part, Procedure
from pipelines.procedures.recorded import ProcedureStep
from schemas.errors import RecipeInvalid
from schemas.recipe import Recipe
from schemas.station import StationConfig


class StaticRecordPart(Part):
    """Duration, pose and temperature are the recipe's keys ``static_record_s``, ``static_pose``, ``static_temperature_C``."""

    kind: Literal["static_record"]


class StaticRecord(Procedure):
    """One long record in one pose."""

    title = "Static record"
    order = 20
    states = "noise terms by the Allan deviation: Q, N, B, K, R"
    source = "IEEE Std 952, IEEE Std 1293"
    part = StaticRecordPart

    def steps(self, part: Any, recipe: Recipe) -> list[ProcedureStep]:
        """A single record in one pose."""
        return [ProcedureStep("static", recipe.static_pose, recipe.static_temperature_C, "allan")]

    def check(self, part: Any, recipe: Recipe, station: StationConfig) -> None:
        """Refuse a record without a duration."""
        if recipe.static_record_s <= 0.0:
            raise RecipeInvalid(
                "recipe: procedures lists static_record and static_record_s is 0 s, a duration is needed; set static_record_s",
                key="static_record_s",
            )


PROCEDURE = StaticRecord()
