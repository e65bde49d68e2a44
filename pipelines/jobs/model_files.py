"""Model files in use: their formulas become effects, their versions a history, and one more effect the next version."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import tomlkit

from inertial import effects
from inertial.effects.formula import Formula
from inertial.errors import InertialError, UnknownEffect
from pipelines.archive import files
from schemas.errors import RecipeInvalid, WrongUse, close_matches, did_you_mean
from schemas.foreign import foreign, shown
from schemas.model import load_model, parse_model
from schemas.recipe import FormulaSpec, read_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from datetime import datetime
    from pathlib import Path

    from tomlkit.items import Array, Table

    from pipelines.archive import Run
    from schemas.model import ModelChange, ModelFile

STARTING_MODEL = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
"""What a new model file begins with: the standard thermal model."""


@dataclass(frozen=True)
class ModelStep:
    """One effect added or removed: who changes the model, when, why, and the run or file that showed it."""

    effect: str
    by: str
    at: datetime
    why: str
    run: str = ""


@dataclass(frozen=True)
class Version:
    """A version of a model: its effects, what was added to and removed from the one before, and the change that says why."""

    number: int
    effects: tuple[str, ...]
    added: tuple[str, ...]
    removed: tuple[str, ...]
    change: ModelChange | None


def read_model(path: Path) -> ModelFile:
    """The model of a file, its formulas known as effects, every effect of it in the catalogue."""
    model = load_model(path)
    _use(model, f"model {path.name}")
    return model


def use_formulas(formulas: Iterable[FormulaSpec], where: str) -> None:
    """Make the formulas of a file effects of the catalogue.

    Raises
    ------
    RecipeInvalid
        A formula is no formula, or its id belongs to an effect of the catalogue.
    """
    for spec in formulas:
        if spec.id in effects.built_in():
            raise RecipeInvalid(
                f"{where}: formula '{spec.id}': the catalogue has an effect of that id; choose another id",
                key="formula.id",
            )
        try:
            made = Formula(spec.id, spec.columns, why=spec.why, symbol=spec.symbol, typical_ug=spec.typical_ug)
        except InertialError as problem:
            raise RecipeInvalid(f"{where}: {problem}", key="formula.columns") from None
        effects.register(made)


def use_formulas_of(run: Run) -> None:
    """Make the formulas that an archived run was fitted with effects of the catalogue."""
    kept = run.about.get("recipe", {}).get("formulas", [])
    use_formulas([FormulaSpec.model_validate(spec) for spec in kept], f"run {run.id}")


def refuse_unknown_effects(names: Sequence[str], where: str) -> None:
    """Refuse names that are no effect, with the close matches."""
    for name in names:
        try:
            effects.get(name)
        except UnknownEffect as problem:
            raise RecipeInvalid(
                f"{where}: unknown effect '{shown(name)}'; {did_you_mean(name, effects.catalogue())}",
                key="effects",
                close=problem.close,
            ) from None


def chosen_effects(listed: str, model: Path | None, where: str) -> list[str] | None:
    """The model that a command was given, as a list of effects or as a file; None where it was given neither."""
    if listed and model is not None:
        raise WrongUse(f"{where}: --effects and --model are both given, one is needed; leave one out")
    if model is not None:
        return list(read_model(model).model.effects)
    names = list(dict.fromkeys(part.strip() for part in listed.split(",") if part.strip()))
    if listed and not names:
        raise WrongUse(
            f"{where}: --effects '{listed}' names no effect; list some (bias,scale,misalignment), or leave it out"
        )
    refuse_unknown_effects(names, where)
    return names or None


def versions(model: ModelFile) -> list[Version]:
    """Every version of a model, oldest first, by walking back from the last over the changes."""
    now = list(model.model.effects)
    found: list[Version] = []
    for change in reversed(model.change):
        effect = change.effect
        before = [e for e in now if e != effect] if effect in now else [*now, *([effect] if effect else [])]
        added, removed = tuple(e for e in now if e not in before), tuple(e for e in before if e not in now)
        found.append(Version(change.version, tuple(now), added, removed, change))
        now = before
    if not found or found[-1].added or found[-1].removed:  # the changes do not tell of the model that it began with
        number = found[-1].number - 1 if found else model.model.version
        found.append(Version(number, tuple(now), (), (), None))
    return found[::-1]


def new_model(path: Path, names: Sequence[str], by: str, at: datetime) -> str:
    """The text of a model file in its first version."""
    refuse_unknown_effects(names, f"model {path.name}")
    document = tomlkit.document()
    document.add(
        tomlkit.comment(
            "A model: the effects that are fitted. 'tumbleline extend' adds one and says who, when and why."
        )
    )
    head = tomlkit.table()
    head.add("name", re.sub(r"[^a-z0-9._-]+", "-", path.stem.lower()).strip("-._") or "model")
    head.add("version", 1)
    head.add("effects", _listed(names))
    document.add("model", head)
    document.add("change", tomlkit.aot())
    first = {"version": 1, "by": by, "at": at, "why": "the model to begin with"}
    document["change"].append(_table(first))  # pyright: ignore[reportArgumentType, reportAttributeAccessIssue, reportUnknownMemberType]
    return tomlkit.dumps(document)


def extended(text: str, step: ModelStep, source: str) -> tuple[str, ModelFile]:
    """The text of the next version of a model, its comments kept, and the model as it then is.

    Raises
    ------
    RecipeInvalid
        The text is no model, the effect is in it already, or nothing is called so.
    """
    model = parse_model(text, source)
    _use(model, source)
    if step.effect in model.model.effects:
        raise RecipeInvalid(
            f"{source}: '{step.effect}' is in version {model.model.version} already; "
            f"its effects are {', '.join(model.model.effects)}",
            key="model.effects",
        )
    refuse_unknown_effects([step.effect], source)
    return _next_version(text, model, step, source)


def reduced(text: str, step: ModelStep, source: str) -> tuple[str, ModelFile]:
    """The text of the next version of a model without an effect, its comments kept, and the model as it then is.

    Raises
    ------
    RecipeInvalid
        The text is no model, the effect is not in it, or it is the only one.
    """
    model = parse_model(text, source)
    _use(model, source)
    present = model.model.effects
    if step.effect not in present:
        raise RecipeInvalid(
            f"{source}: '{shown(step.effect)}' is not in version {model.model.version}, only an effect of the model can be "
            f"removed; {did_you_mean(step.effect, present)}",
            key="model.effects",
            close=close_matches(step.effect, present),
        )
    if len(present) == 1:
        raise RecipeInvalid(
            f"{source}: '{step.effect}' is the only effect of version {model.model.version}, a model needs one at least; "
            "add another effect first",
            key="model.effects",
        )
    return _next_version(text, model, step, source)


def _next_version(text: str, model: ModelFile, step: ModelStep, source: str) -> tuple[str, ModelFile]:
    """The next version: without the effect where the model has it, with it where it does not."""
    with foreign(f"{source}: not valid TOML", "correct the file", RecipeInvalid):
        document = tomlkit.parse(text)
    head = document["model"]
    version = model.model.version + 1
    head["version"] = version  # pyright: ignore[reportIndexIssue]
    listed = head["effects"]  # pyright: ignore[reportIndexIssue, reportUnknownVariableType]
    change = listed.remove if step.effect in model.model.effects else listed.append  # pyright: ignore[reportAttributeAccessIssue, reportUnknownMemberType, reportUnknownVariableType]
    change(step.effect)
    changes = document.setdefault("change", tomlkit.aot())
    if not model.change:
        known = {
            "version": model.model.version,
            "by": step.by,
            "at": step.at,
            "why": "as it was found, without a history",
        }
        changes.append(_table(known))
    told = {"version": version, "effect": step.effect, "by": step.by, "at": step.at, "why": step.why}
    changes.append(_table(told | ({"run": step.run} if step.run else {})))
    new = tomlkit.dumps(document)
    return new, parse_model(new, source)


def publish_model(path: Path, text: str) -> None:
    """Write a model file so that it is there whole or as it was before."""
    files.publish(path, text.encode(), "model", files.ELSEWHERE)


def model_text(path: Path) -> str:
    """The text of a model file."""
    return read_text(path, "model")


def _use(model: ModelFile, source: str) -> None:
    use_formulas(model.formula, source)
    refuse_unknown_effects(model.model.effects, f"{source}: key 'effects'")


def _listed(names: Sequence[str]) -> Array:
    listed = tomlkit.array()
    listed.extend(names)
    return listed.multiline(multiline=True)


def _table(content: Mapping[str, object]) -> Table:
    table = tomlkit.table()
    table.trivia.indent = "\n"  # a blank line before each change
    for key, value in content.items():
        table.add(key, value)
    return table
