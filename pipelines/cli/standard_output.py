"""``-`` as the name of an output file: standard output, as the programs of a system understand it."""

from __future__ import annotations

from pathlib import Path

import typer

from schemas.errors import WrongUse

NAME = Path("-")


def is_standard_output(path: Path | None, command: str, *, as_json: bool = False) -> bool:
    """Whether a file is to be printed; refused beside a JSON document, which has standard output for itself."""
    if path == NAME and as_json:
        raise WrongUse(
            f"{command}: --json and the output '-' both print on standard output, one is possible; leave one out"
        )
    return path == NAME


def refuse_standard_output(path: Path | None, command: str, why: str) -> None:
    """Refuse ``-`` where a file of the system is needed."""
    if path == NAME:
        raise WrongUse(f"{command}: output '-' is standard output, a file is needed: {why}; name one")


def print_text(text: str) -> None:
    """A file's text on standard output, byte for byte."""
    typer.echo(text, nl=False)
