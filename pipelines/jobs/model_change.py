"""The change for a re-run: model, limits or nothing. Plain values, so that they can be sent to workers."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from inertial.effects import add_file
from pipelines.jobs.model_files import chosen_effects, model_keys, read_model, use_formulas
from pipelines.jobs.recipes import read_limits
from schemas.limits import Limits
from schemas.recipe import FormulaSpec


@dataclass(frozen=True)
class ModelChange:
    """The model and limits for a re-run; None: as in the run."""

    effects: tuple[str, ...] | None = None
    formulas: tuple[FormulaSpec, ...] = ()
    model_name: str = ""
    model_version: int = 0
    limits: Limits | None = None
    limits_name: str = ""
    effect_files: tuple[str, ...] = ()

    def of_model(self) -> dict[str, Any]:
        """The keys of the recipe for the new model; empty where the model stays."""
        if self.effects is None:
            return {}
        return {
            "effects": list(self.effects),
            "formulas": list(self.formulas),
            "model_name": self.model_name,
            "model_version": self.model_version,
        }

    def use(self) -> None:
        """Add the formulas of the model and the effects of effect files to the catalogue of this process."""
        for path in self.effect_files:
            if path not in _added:
                add_file(path)
                _added.add(path)
        use_formulas(self.formulas, f"model {self.model_name}")


_added: set[str] = set()


def change_from_options(
    effects: str = "",
    model: Path | None = None,
    limits: str = "",
    effect_files: Sequence[Path] | None = None,
    *,
    where: str = "rerun",
) -> ModelChange:
    """The change from the options of a command: effects, model file, limits and effect files.

    Raises WrongUse, RecipeInvalid: effects and a model are both given; an effect, the file or the limits are unknown.
    """
    outside = tuple(str(path.resolve()) for path in effect_files or ())
    ModelChange(effect_files=outside).use()
    names = chosen_effects(effects, model, where)
    keys: dict[str, Any] = {"effects": names} if model is None else model_keys(read_model(model))
    stated: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in keys.items()}
    chosen = read_limits(limits) if limits else None
    return ModelChange(**stated, limits=chosen, limits_name=limits, effect_files=outside)
