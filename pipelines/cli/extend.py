"""``tumbleline extend``: the next version of a model, with one more effect; it records who added it, when and why."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pipelines.cli.options import EffectFileOption, JsonOption, console, print_json
from schemas.errors import WrongUse

PART = "Is the model good enough, and what is missing?"
ORDER = 230
SUMMARY = "Write the next version of a model with one more effect."


def command(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL", help="A model file; a new file starts with a starting model.")
    ],
    effect: Annotated[
        str,
        typer.Argument(
            metavar="EFFECT",
            help="Id of an effect in the catalogue, covariate:<column>, or a formula in an effect file.",
        ),
    ],
    why: Annotated[str, typer.Option("--why", metavar="TEXT", help="Reason for the effect.")] = "",
    by: Annotated[str, typer.Option("--by", metavar="NAME", help="Name of the author; default: the user's name.")] = "",
    run: Annotated[str, typer.Option("--run", metavar="RUN", help="The run or file that shows the effect.")] = "",
    output: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="Write the new version to this file; MODEL is not changed."),
    ] = None,
    effects: Annotated[
        str,
        typer.Option(
            "--effects", metavar="a,b,c", help="The starting model of a new file; default: bias to scale_temperature."
        ),
    ] = "",
    effect_file: EffectFileOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Write the next version of a model with one more effect; it records who added it, when and why.

    Where MODEL does not exist, it is created: version 1 has the starting model, version 2 the effect as well.
    """
    from pipelines.cli.inputs import add_effect_files
    from pipelines.jobs.model_files import extended, publish_model

    add_effect_files(effect_file)
    step = _step(effect, why, by, run)
    text, begun = _start(model, effects, step)
    new, after = extended(text, step, f"model {model.name}")
    target = output or model
    publish_model(target, new)
    document: dict[str, Any] = {
        "file": str(target),
        "model": after.model.name,
        "version": after.model.version,
        "effects": after.model.effects,
        "added": effect,
        "begun": begun,
        "by": step.by,
        "at": step.at.isoformat(),
        "why": step.why,
    }
    if as_json:
        print_json(document)
        return
    out = console()
    if begun:
        first = ", ".join(e for e in after.model.effects if e != effect)
        out.print(f"{target}: begun with version 1: {first}", markup=False, soft_wrap=True)
    out.print(f"{target}: version {after.model.version} has {effect} ({step.why})", markup=False, soft_wrap=True)


def _step(effect: str, why: str, by: str, run: str) -> Any:
    """The change to make; missing values are filled in from the run."""
    import getpass
    from datetime import UTC, datetime

    from pipelines.jobs.model_files import ModelStep

    reason = why.strip() or (f"the diagnosis of {run} names the effect" if run else "no reason given")
    at = datetime.now(UTC).replace(microsecond=0)
    return ModelStep(effect.strip(), by.strip() or getpass.getuser(), at, reason, run)


def _start(model: Path, effects: str, step: Any) -> tuple[str, bool]:
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
