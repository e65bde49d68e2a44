"""``tumbleline extend``: the next version of a model, with one more effect, and who added it, when and why."""

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
        Path, typer.Argument(metavar="MODEL", help="A model file; begun with a starting model where there is none.")
    ],
    effect: Annotated[
        str,
        typer.Argument(metavar="EFFECT", help="An id of the catalogue, covariate:<column>, or a formula of the file."),
    ],
    why: Annotated[str, typer.Option("--why", metavar="TEXT", help="What speaks for it.")] = "",
    by: Annotated[str, typer.Option("--by", metavar="NAME", help="Who adds it; the user's name by default.")] = "",
    run: Annotated[str, typer.Option("--run", metavar="RUN", help="The run or file that showed it.")] = "",
    output: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="Write the new version here, leave MODEL as it is."),
    ] = None,
    effects: Annotated[
        str,
        typer.Option(
            "--effects", metavar="a,b,c", help="The starting model of a new file; bias to scale_temperature by default."
        ),
    ] = "",
    effect_file: EffectFileOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Write the next version of a model with one more effect, and who added it, when and why.

    MODEL that is not there yet is begun: version 1 holds the starting model, version 2 the effect.
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
    """The change to make, its blanks filled with what is known."""
    import getpass
    from datetime import UTC, datetime

    from pipelines.jobs.model_files import ModelStep

    reason = why.strip() or (f"a diagnosis of {run} names it" if run else "no reason was given")
    at = datetime.now(UTC).replace(microsecond=0)
    return ModelStep(effect.strip(), by.strip() or getpass.getuser(), at, reason, run)


def _start(model: Path, effects: str, step: Any) -> tuple[str, bool]:
    """The text to extend, and whether it was begun just now."""
    from pipelines.jobs.model_files import STARTING_MODEL, model_text, new_model

    if model.exists():
        if effects:
            raise WrongUse(
                f"extend: {model} is there, --effects is for a new file; leave --effects out, or name another file"
            )
        return model_text(model), False
    names = [part.strip() for part in effects.split(",") if part.strip()] or list(STARTING_MODEL)
    return new_model(model, list(dict.fromkeys(names)), step.by, step.at), True
