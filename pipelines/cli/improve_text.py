"""An improvement of a model for people: choices, error of each version, and the next command."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

from pipelines.cli.options import console, print_table, short

if TYPE_CHECKING:
    from pathlib import Path

FRESH, FRESH_HISTORY = "ANOTHER-RUN-OF-THE-SAME-UNITS", "ITS-HISTORY"
ERRORS = {
    "fitted_ug": "fitted to these dwells",
    "heldout_ug": "dwells left out: the worst of poses, soaks, stretches of time",
    "fresh_ug": "fresh run, coefficients unchanged",
    "noise_ug": "noise of the measurement",
}


def print_heading(text: str, *, quiet: bool) -> None:
    """Print a heading, unless the output is a document."""
    if not quiet:
        console().print(f"\n{text}", style="bold cyan", markup=False, soft_wrap=True)


def print_verdict(document: dict[str, Any]) -> None:
    """Print the verdict of a diagnosis."""
    from pipelines.cli.diagnosis_text import STYLE_OF, verdict

    console().print(verdict(document), style=STYLE_OF[document["adequate"]], soft_wrap=True)


def print_improvement(document: dict[str, Any]) -> None:
    """Print what was added, the ladder of errors, and the next command; the diagnoses are printed as they are made."""
    _choices(document)
    _ladder(document["ladder"])
    out = console()
    for text in document["warnings"]:
        out.print(f"warning: {text}", style="yellow", markup=False, soft_wrap=True)
    if document["next"]:
        out.print("\nNext:", style="bold")
        for line in document["next"]:
            out.print(f"  {line}", markup=False, soft_wrap=True)


def _choices(document: dict[str, Any]) -> None:
    out = console()
    for choice in document["choices"]:
        effect, others = choice["effect"], ", ".join(choice["not_separated_from"])
        text = f"{document['file']}: added {effect}" if choice["added"] else f"{effect} is not added"
        if others:
            text += f"; these data do not separate it from {others}"
        if choice["decided_by"] == "undecided":
            text += "; --yes does not decide between them: name one with --effect"
        out.print(text, style="" if choice["added"] else "yellow", markup=False, soft_wrap=True)


def _ladder(rows: list[dict[str, Any]]) -> None:
    if not rows:
        return
    heads = [f"version {row['version']}" + "".join(f"\n+ {name}" for name in row["added"]) for row in rows]
    lines = [
        [text, *(short(row[key]) for row in rows)]
        for key, text in ERRORS.items()
        if any(row[key] is not None for row in rows)
    ]
    print_table(["error, µg rms", *heads], lines, title="Error by version of the model", whole=0)
    for row in rows[1:]:
        style = {True: "bold green", False: "bold red", None: "yellow"}[row["confirmed"]]
        console().print(f"{', '.join(row['added'])}: {row['text']}", style=style, markup=False, soft_wrap=True)


def next_lines(
    document: dict[str, Any],
    target: Path,
    history: str,
    *,
    after: dict[str, Any],
    fresh: bool,
    archive: str | None = None,
) -> list[str]:
    """The commands to give next; empty where the model is adequate and a fresh run has judged it.

    Parameters
    ----------
    target : the model file
    history : the file of temperatures against time that was read; empty where there was none
    after : the diagnosis of the resulting model
    fresh : whether there was a fresh run
    archive : as it was given; None for the default one
    """
    from pipelines.cli.history import removal

    if document["refuted"]:
        return [removal(target, effect) for effect in document["refuted"]]
    temperatures = [*(["--history", history] if history else []), *(["--archive", archive] if archive else [])]
    own = ["--model", str(target)] if document["file"] else ["--effects", ",".join(document["effects"])]
    again = ["tumbleline", "improve", document["data"], *own, *temperatures]
    left = [c for c in document["choices"] if not c["added"]]
    if left:
        return [shlex.join([*again, "--effect", name]) for name in (left[0]["effect"], *left[0]["not_separated_from"])]
    lines: list[str] = []
    if document["added"] and not fresh:
        its_own = ["--fresh-history", FRESH_HISTORY] if history else []
        lines = [
            shlex.join(
                [
                    "tumbleline",
                    "history",
                    str(target),
                    "--dwells",
                    document["data"],
                    *temperatures,
                    "--fresh",
                    FRESH,
                    *its_own,
                ]
            )
        ]
    return [*lines, shlex.join(again)] if after["recommended"] else lines
