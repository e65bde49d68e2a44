"""Model files: formulas as effects, versions as a history, and the next version with one more effect."""

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Table

from inertial import effects
from inertial.effects.formula import Formula
from inertial.errors import InertialError, UnknownEffect
from pipelines.archive import Run, files
from schemas.errors import RecipeInvalid, WrongUse, close_matches, did_you_mean
from schemas.foreign import foreign, shown
from schemas.model import ModelFile, VersionStep
from schemas.recipe import FormulaSpec
from schemas.toml_files import parse_as, read_text

STARTING_MODEL = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
"""The effects of a new model file: the standard thermal model."""


@dataclass(frozen=True)
class ModelStep:
    """One effect added or removed: author, time, reason, and the run or file that shows it."""

    effect: str
    by: str
    at: datetime
    why: str
    run: str = ""


@dataclass(frozen=True)
class Version:
    """A version of a model: its effects, the added and removed effects, and the change with its reason."""

    number: int
    effects: tuple[str, ...]
    added: tuple[str, ...]
    removed: tuple[str, ...]
    change: VersionStep | None


def read_model(path: Path) -> ModelFile:
    """The model of a file; its formulas become effects, and all its effects are checked against the catalogue."""
    source = f"model {path.name}"
    return _used(parse_as(ModelFile, read_text(path, "model"), source), source)


def model_keys(file: ModelFile) -> dict[str, Any]:
    """The keys of a recipe that state the model of a file."""
    model = file.model
    return {
        "effects": model.effects,
        "formulas": file.formula,
        "model_name": model.name,
        "model_version": model.version,
    }


def use_formulas(formulas: Iterable[FormulaSpec], where: str) -> None:
    """Add the formulas of a file to the catalogue of effects.

    Raises RecipeInvalid: a formula is invalid, or its id belongs to an effect of the catalogue.
    """
    for spec in formulas:
        if spec.id in effects.built_in():
            raise RecipeInvalid(
                f"{where}: formula '{spec.id}': the catalogue has an effect with this id; choose another id",
                key="formula.id",
            )
        try:
            made = Formula(spec.id, spec.columns, why=spec.why, symbol=spec.symbol, typical_ug=spec.typical_ug)
        except InertialError as problem:
            raise RecipeInvalid(f"{where}: {problem}", key="formula.columns") from None
        effects.register(made)


def use_formulas_of(run: Run) -> None:
    """Add the formulas of the model of an archived run to the catalogue of effects."""
    formulas = run.about.get("recipe", {}).get("formulas", [])
    use_formulas([FormulaSpec.model_validate(spec) for spec in formulas], f"run {run.id}")


def effect_file_hashes(names: Iterable[str]) -> dict[str, str]:
    """Effect → hash of the Python file (``--effect-file``) that it is of; others are left out."""
    modules = {name: type(effects.get(name)).__module__ for name in names}
    of_files = {name: module for name, module in modules.items() if module.startswith(effects.OF_A_FILE)}
    return {name: files.sha256(Path(str(sys.modules[module].__file__))) for name, module in of_files.items()}


def changed_effects(run: Run) -> list[str]:
    """Effects of effect files that have another state than those that the coefficients of a run are of."""
    parameters = run.manifest("coefficients")["parameters"] if "coefficients" in run.tables() else {}
    fitted = parameters.get("effect_files", {})
    return [name for name, now in effect_file_hashes(fitted).items() if now != fitted[name]]


def use_fitted_model(run: Run, effect_files: Iterable[Path] | None) -> None:
    """Add the effects that the coefficients of a run are of to the catalogue; refuse a file that is not that of the fit."""
    for path in effect_files or ():
        effects.add_file(path)
    use_formulas_of(run)
    if other := changed_effects(run):
        raise WrongUse(
            f"run {run.id}: {other[0]} was fitted with another state of the effect file, which its coefficients belong to; give "
            f"the file of that fit, or fit again with this one: 'tumbleline fit {run.id} --effect-file FILE.py'"
        )


def refuse_unknown_effects(names: Sequence[str], where: str) -> None:
    """Refuse unknown effects, with similar names."""
    for name in names:
        try:
            effects.get(name)
        except UnknownEffect as problem:
            raise RecipeInvalid(
                f"{where}: unknown effect '{shown(name, 40)}'; {did_you_mean(name, effects.catalogue())}; "
                "one of a Python file needs --effect-file FILE.py, or its package",
                key="effects",
                close=problem.close,
            ) from None


def chosen_effects(listed: str, model: Path | None, where: str) -> list[str] | None:
    """The model of a command's options, from a list of effects or a file; None without either."""
    if listed and model is not None:
        raise WrongUse(f"{where}: --effects and --model are both given, one is needed; leave one out")
    if model is not None:
        return list(read_model(model).model.effects)
    names = list(dict.fromkeys(part.strip() for part in listed.split(",") if part.strip()))
    if listed and not names:
        raise WrongUse(
            f"{where}: --effects '{listed}' names no effect, one is needed; list some (bias,scale,misalignment), or leave it out"
        )
    refuse_unknown_effects(names, where)
    return names or None


def versions(model: ModelFile) -> list[Version]:
    """Every version of a model, oldest first, reconstructed from the last version and the changes."""
    now = list(model.model.effects)
    versions: list[Version] = []
    for change in reversed(model.change):
        effect = change.effect
        before = [e for e in now if e != effect] if effect in now else [*now, *([effect] if effect else [])]
        added, removed = tuple(e for e in now if e not in before), tuple(e for e in before if e not in now)
        versions.append(Version(change.version, tuple(now), added, removed, change))
        now = before
    if not versions or versions[-1].added or versions[-1].removed:  # the changes do not include the starting model
        number = versions[-1].number - 1 if versions else model.model.version
        versions.append(Version(number, tuple(now), (), (), None))
    return versions[::-1]


def new_model(path: Path, names: Sequence[str], by: str, at: datetime) -> str:
    """The text of a model file in its first version."""
    refuse_unknown_effects(names, f"model {path.name}")
    document = tomlkit.document()
    document.add(
        tomlkit.comment(
            "A model: the effects that are fitted. 'tumbleline extend' adds one and records author, time and reason."
        )
    )
    head = tomlkit.table()
    head.add("name", re.sub(r"[^a-z0-9._-]+", "-", path.stem.lower()).strip("-._") or "model")
    head.add("version", 1)
    effects_item = tomlkit.array()
    effects_item.extend(names)
    head.add("effects", effects_item.multiline(multiline=True))
    document.add("model", head)
    document.add("change", tomlkit.aot())
    first = {"version": 1, "by": by, "at": at, "why": "starting model"}
    document["change"].append(_table(first))  # pyright: ignore[reportArgumentType, reportAttributeAccessIssue, reportUnknownMemberType]
    return tomlkit.dumps(document)


def extended(text: str, step: ModelStep, source: str) -> tuple[str, ModelFile]:
    """The text of the next version of a model, with its comments, and the model of this version.

    Raises RecipeInvalid: the text is no model, the effect is already in it, or its name is unknown.
    """
    model = _used(parse_as(ModelFile, text, source), source)
    if step.effect in model.model.effects:
        raise RecipeInvalid(
            f"{source}: '{step.effect}' is in version {model.model.version} already; "
            f"its effects are {', '.join(model.model.effects)}",
            key="model.effects",
        )
    refuse_unknown_effects([step.effect], source)
    return _next_version(text, model, step, source)


def reduced(text: str, step: ModelStep, source: str) -> tuple[str, ModelFile]:
    """The text of the next version of a model without an effect, with its comments, and that version of the model.

    Raises RecipeInvalid: the text is no model, the effect is not in it, or it is the only one.
    """
    model = _used(parse_as(ModelFile, text, source), source)
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
        first = {"version": model.model.version, "by": step.by, "at": step.at, "why": "file without a history"}
        changes.append(_table(first))
    change = {"version": version, "effect": step.effect, "by": step.by, "at": step.at, "why": step.why}
    changes.append(_table(change | ({"run": step.run} if step.run else {})))
    new = tomlkit.dumps(document)
    return new, parse_as(ModelFile, new, source)


def publish_model(path: Path, text: str) -> None:
    """Write a model file atomically."""
    files.publish(path, text.encode(), "model", files.ELSEWHERE)


def model_text(path: Path) -> str:
    """The text of a model file."""
    return read_text(path, "model")


def _used(model: ModelFile, source: str) -> ModelFile:
    """The model; its formulas are effects now, and all its effects are known."""
    use_formulas(model.formula, source)
    refuse_unknown_effects(model.model.effects, f"{source}: key 'effects'")
    return model


def _table(content: Mapping[str, object]) -> Table:
    table = tomlkit.table()
    table.trivia.indent = "\n"  # a blank line before each change
    for key, value in content.items():
        table.add(key, value)
    return table


def model_step(effect: str, why: str, by: str, run: str) -> ModelStep:
    """The change to make, missing values are filled in from the run."""
    import getpass

    reason = why.strip() or (f"the diagnosis of {run} names the effect" if run else "no reason given")
    at = datetime.now(UTC).replace(microsecond=0)
    return ModelStep(effect.strip(), by.strip() or getpass.getuser(), at, reason, run)
