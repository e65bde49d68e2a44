"""``tumbleline extend``: the next version of a model, one effect added or removed, and who changed it, when and why."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pipelines.cli.options import (
    EffectFileOption,
    FormulaOption,
    JsonOption,
    ReasonOption,
    WhoOption,
    argument,
    names_in,
    option,
)
from pipelines.cli.printing import give, is_standard_output, print_text, remark, say
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.cli.documents.decisions import ExtendDocument
    from pipelines.jobs.model_files import ModelStep

PART = "Is the model good enough, and what is missing?"
ORDER = 230
SUMMARY = "Write the next version of a model: one effect more, or one removed."
EXAMPLES = (
    "tumbleline extend model.toml third_order --reason 'the diagnosis names it'",
    "tumbleline extend model.toml --remove third_order --reason 'not seen in the fresh run'",
)


def command(
    model: Annotated[Path, argument("MODEL", "A model file; a new file starts with a starting model.")],
    effect: Annotated[
        str,
        argument("[EFFECT]", "Effect to add: an id of the catalogue, covariate:<column>, or a formula of the file."),
    ] = "",
    remove: Annotated[
        str, option("--remove EFFECT", "Effect to remove instead; earlier versions stay in the file.")
    ] = "",
    reason: ReasonOption = "",
    who: WhoOption = "",
    dwells: Annotated[str, option("--dwells DWELLS", "Run or file with the evidence.")] = "",
    output: Annotated[
        Path | None,
        option(
            "--output -o FILE",
            "Write the new version to this file, or with - to standard output; MODEL is not changed.",
        ),
    ] = None,
    effects: Annotated[
        str, option("--effects a,b,c", "The starting model of a new file; default: bias to scale_temperature.")
    ] = "",
    effect_file: EffectFileOption = None,
    formula: FormulaOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Write the next version of a model with one effect more or less, and who changed it, when and why.

    A MODEL that does not exist is created: version 1 has the starting model, version 2 the effect. A removed effect stays in the
    history of the file, with the reason.
    """
    from pipelines.cli.inputs import add_effects
    from pipelines.diagnosis.inputs import with_formulas
    from pipelines.jobs.model_files import extended, model_step, publish_model, reduced

    printed = is_standard_output(output, "extend", as_json=as_json)
    _refuse_contradiction(model, effect, remove, reason)
    add_effects(effect_file, formula, "extend")
    step = model_step(remove or effect, reason, who, dwells)
    text, begun = _start(model, effects, step)
    text = with_formulas(text, formula or (), [*names_in(effects), effect])
    new, after = (reduced if remove else extended)(text, step, f"model {model.name}")
    target = output or model
    if printed:
        print_text(new)
    else:
        publish_model(target, new)
    document: ExtendDocument = {
        "file": str(target),
        "model": after.model.name,
        "version": after.model.version,
        "effects": after.model.effects,
        "added": effect or None,
        "removed": remove or None,
        "begun": begun,
        "by": step.by,
        "at": step.at.isoformat(),
        "why": step.why,
    }
    change = f"removes {step.effect}" if remove else f"has {step.effect}"
    lines = [f"{target}: version {after.model.version} {change} ({step.why})"]
    if begun:
        first = ", ".join(e for e in after.model.effects if e != effect)
        lines.insert(0, f"{target}: created with version 1: {first}")
    give(document, lambda _: [(remark if printed else say)(line) for line in lines], as_json=as_json)


def _refuse_contradiction(model: Path, effect: str, remove: str, reason: str) -> None:
    """Refuse a change that is none, two, or a removal without a reason or a model."""
    if bool(effect.strip()) == bool(remove.strip()):
        found = "EFFECT and --remove are both given" if effect.strip() else "no effect is given"
        raise WrongUse(
            f"extend: {found}, one effect is needed; give 'extend {model} EFFECT' to add it, or 'extend {model} --remove EFFECT "
            "--reason TEXT' to remove it"
        )
    if remove and not reason.strip():
        raise WrongUse(
            f"extend: --remove {remove} has no reason, the history needs one; add --reason TEXT, such as the verdict of "
            f"'tumbleline history {model}'"
        )
    if remove and not model.exists():
        raise WrongUse(f"extend: {model} does not exist, --remove needs a model file; correct the name")


def _start(model: Path, effects: str, step: "ModelStep") -> tuple[str, bool]:
    """The text to extend, and whether the file is new."""
    from pipelines.jobs.model_files import STARTING_MODEL, model_text, new_model

    if model.exists():
        if effects:
            raise WrongUse(
                f"extend: {model} exists, --effects is for a new file; leave --effects out, or name another file"
            )
        return model_text(model), False
    names = [part.strip() for part in effects.split(",") if part.strip()] or list(STARTING_MODEL)
    return new_model(model, list(dict.fromkeys(names)), step.by, step.at), True
