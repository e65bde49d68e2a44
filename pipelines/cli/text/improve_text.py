"""An improvement of a model for people: choices, error of each version, and the next command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipelines.cli.next_commands import FindData, command_line, fresh_measurement, print_next
from pipelines.cli.printing import print_table, say, short, warn

ERRORS = {
    "fitted_ug": "fitted to these dwells",
    "heldout_ug": "dwells left out: the worst of poses, soaks, stretches of time",
    "fresh_ug": "fresh run, coefficients unchanged",
    "noise_ug": "noise of the measurement",
}


def print_improvement(document: dict[str, Any]) -> None:
    """Print what was added, the ladder of errors, and the next command; the diagnoses are printed as they are made."""
    _choices(document)
    _ladder(document["ladder"])
    warn(document["warnings"])
    print_next(document["next"])


def _choices(document: dict[str, Any]) -> None:
    for choice in document["choices"]:
        effect, others = choice["effect"], ", ".join(choice["not_separated_from"])
        text = f"{document['file']}: added {effect}" if choice["added"] else f"{effect} is not added"
        if others:
            text += f"; these data do not separate it from {others}"
        if choice["decided_by"] == "undecided":
            text += "; --yes does not decide between them: name one with --effect"
        say(text, style="" if choice["added"] else "yellow")


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
        say(f"{', '.join(row['added'])}: {row['text']}", style=style)


def next_lines(document: dict[str, Any], target: Path, find: FindData, *, after: dict[str, Any]) -> list[str]:
    """The commands to give next; empty where the model is adequate and a fresh run has judged it.

    Parameters
    ----------
    target : the model file
    find : gives the data
    after : the diagnosis of the resulting model
    """
    from pipelines.cli.history import removal

    if document["refuted"]:
        return [removal(target, effect) for effect in document["refuted"]]
    left = [c for c in document["choices"] if not c["added"]]
    if not (left or after["recommended"] or (document["added"] and not document["fresh"])):
        return []
    data = find()
    own = ["--model", str(target)] if document["file"] else ["--effects", ",".join(document["effects"])]
    again = ["improve", data.source, *own, *data.options]
    if left:
        names = (left[0]["effect"], *left[0]["not_separated_from"])
        return [command_line(*again, "--effect", name) for name in names]
    lines = fresh_measurement(target, data) if document["added"] and not document["fresh"] else []
    return [*lines, command_line(*again)] if after["recommended"] else lines
