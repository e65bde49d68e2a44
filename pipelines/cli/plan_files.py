"""The files that tumbleline plan writes: a recipe, a page, pictures."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipelines.planning.context import PlanContext


def save(path: Path, text: str) -> None:
    """Write a file; a folder that does not exist or cannot be written to is wrong use."""
    from schemas.errors import WrongUse

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as problem:
        raise WrongUse(
            f"plan: {path} cannot be written ({problem.strerror}); give a file in a folder that exists and is writable"
        ) from None


def write_page(page: Path, document: dict[str, Any], context: PlanContext) -> None:
    """Write the page."""
    from pipelines.report.plan import render_plan

    save(page, render_plan(document, context))


def write_pictures(folder: Path, document: dict[str, Any], context: PlanContext) -> None:
    """Write each picture to a file."""
    from pipelines.drawing.vector import alone
    from pipelines.report.plan import pictures

    with contextlib.suppress(OSError):  # what is wrong with the folder is said where a picture cannot be written to it
        folder.mkdir(parents=True, exist_ok=True)
    for name, text in pictures(document, context).items():
        if text:
            save(folder / f"{document['recipe']}-{name}.svg", alone(text))
