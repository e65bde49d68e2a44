"""Model files: a named, versioned list of effects, and the history of who changed it, when and why."""

from datetime import date, datetime
from typing import Annotated

from pydantic import Field, model_validator

from schemas.bounds import Name, Text
from schemas.recipe import FormulaSpec
from schemas.strict import Strict, refuse_repeated

MOST_VERSIONS = 1_000_000


class VersionStep(Strict):
    """One step of a model's history: the version that it led to, the effect added or removed, by whom, when, why.

    ``run`` is the run or file of dwells that the change was decided on.
    """

    version: Annotated[int, Field(ge=1, le=MOST_VERSIONS)]
    effect: str = ""
    by: Annotated[Text, Field(min_length=1)]
    at: datetime | date
    why: Annotated[Text, Field(min_length=1)]
    run: Text = ""


class ModelHead(Strict):
    """Name, version and effects of a model."""

    name: Annotated[Name, Field(pattern=r"^[a-z0-9][a-z0-9._-]*$")]
    version: Annotated[int, Field(ge=1, le=MOST_VERSIONS)]
    effects: Annotated[list[str], Field(min_length=1, max_length=1000)]


class ModelFile(Strict):
    """A model as it stands in its file: ``[model]``, one ``[[change]]`` per version, and ``[[formula]]`` for its own effects."""

    model: ModelHead
    formula: list[FormulaSpec] = Field(default_factory=list)
    change: list[VersionStep] = Field(default_factory=list)

    @model_validator(mode="after")
    def _consistent(self) -> "ModelFile":
        refuse_repeated(self.model.effects, "model.effects: ", "remove the second")
        refuse_repeated((formula.id for formula in self.formula), "formula: ", "rename the second")
        versions = [change.version for change in self.change]
        if versions != sorted(set(versions)):
            raise ValueError(f"change: versions {versions} do not rise; write one [[change]] per version, oldest first")
        if versions and versions[-1] != self.model.version:
            raise ValueError(
                f"model.version: {self.model.version}, but the last [[change]] led to {versions[-1]}; "
                "every version needs its [[change]]"
            )
        return self
