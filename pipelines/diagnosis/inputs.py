"""Inputs for the judgement of a model: dwells with their temperature history, the model, and formulas."""

import logging
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Literal

import pandas as pd

from inertial.errors import UnknownEffect
from pipelines.archive import Archive, Run
from pipelines.importers.exchange import read_dwells, read_history
from pipelines.importers.files import is_file
from pipelines.jobs.model_files import changed_effects, chosen_effects, use_formulas, use_formulas_of
from schemas.errors import WrongUse
from schemas.foreign import shown
from schemas.recipe import FormulaSpec

LOGGER = logging.getLogger("tumbleline.diagnosis")
WHY = "entered as a formula"


def dwells_and_history(source: str, history: str, archive: str | None) -> tuple[pd.DataFrame, pd.DataFrame | None, str]:
    """The dwells of a file or run, their temperature history (None if there is none), and the file of that history (else "").

    Parameters
    ----------
    history : file of the history; empty for the history of the run, or for the file beside a file of dwells
    """
    dwells = read_dwells(source, archive=archive)
    beside = history or (file_beside(source, "history") if is_file(source) else "")
    if beside:
        return dwells, read_history(beside, archive=archive), beside
    if is_file(source) or "history" not in Archive(archive).run(source).tables():
        return dwells, None, ""
    return dwells, read_history(source, archive=archive), ""


def file_beside(source: str, what: Literal["history", "fresh"]) -> str:
    """Path of the history or fresh run beside a file of dwells: NAME-history, or history for a file dwells; else empty."""
    dwells = Path(source)
    stems = [f"{dwells.stem}-{what}", f"{dwells.stem}_{what}"]
    if dwells.stem.endswith("dwells"):
        stems.append(f"{dwells.stem.removesuffix('dwells')}{what}")
    endings = dict.fromkeys((dwells.suffix, ".parquet", ".csv"))
    paths = (dwells.with_name(stem + ending) for stem in stems for ending in endings)
    return next((str(path) for path in paths if path.is_file()), "")


def judged_effects(source: str, archive: str | None, listed: str, model: Path | None, where: str) -> list[str] | None:
    """Effects of the model that is judged: the given model, else that of the run; None if there is neither.

    Parameters
    ----------
    listed : effects, divided by commas; empty if none is named
    where : the command, for its messages
    """
    chosen = chosen_effects(listed, model, where)
    store = Archive(archive)
    if chosen or is_file(source) or not store.runs():
        return chosen
    return effects_of(store.run(source))


def effects_of(run: Run) -> list[str] | None:
    """Effects of the model of a run, with its formulas in the catalogue; None if it has no model."""
    use_formulas_of(run)
    with suppress(UnknownEffect):  # refused with what to give where the model is made
        for name in changed_effects(run):
            LOGGER.warning("run %s: %s was fitted with another state of its file; this one is judged", run.id, name)
    return list(run.about.get("recipe", {}).get("effects", ())) or None


def use_written_formulas(written: Sequence[str], where: str) -> list[str]:
    """Add formulas ``id = expression; expression`` to the catalogue of effects; returns their ids.

    Raises
    ------
    WrongUse
        One has no id or no expression.
    RecipeInvalid
        An expression is not valid.
    """
    specs = [_specified(text, where) for text in written]
    use_formulas(specs, where)
    return [spec.id for spec in specs]


def _specified(text: str, where: str) -> FormulaSpec:
    name, equals, rest = text.partition("=")
    columns = [part.strip() for part in rest.split(";") if part.strip()]
    if not (equals and name.strip() and columns):
        raise WrongUse(
            f"{where}: formula '{shown(text)}', id = expression is needed; write one such as humid = humidity_pct - 45"
        )
    if not name.strip().replace("_", "a").isalnum() or not name.strip()[0].isalpha():
        raise WrongUse(
            f"{where}: formula '{shown(text)}': an id of letters, digits and _ is needed; write one such as humid = …"
        )
    return FormulaSpec(id=name.strip().lower(), columns=columns, why=WHY)


def with_formulas(text: str, formulas: Sequence[str], used: Sequence[str]) -> str:
    """The text of a model file, with those formulas appended that are used and missing in it."""
    for written in formulas:
        name, _, rest = written.partition("=")
        known = name.strip().lower()
        if known in used and f'id = "{known}"' not in text:
            columns = ", ".join(f'"{part.strip()}"' for part in rest.split(";") if part.strip())
            text = f'{text.rstrip()}\n\n[[formula]]\nid = "{known}"\ncolumns = [{columns}]\nwhy = "{WHY}"\n'
    return text
