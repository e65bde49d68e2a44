"""The files in the folder of a run: which stages made its tables, and the seal that names them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.archive import files

if TYPE_CHECKING:
    from pipelines.archive.store import Place

SEALED = "sealed.json"


def stages_of(folder: Place, names: set[str] | None = None) -> list[str]:
    """The stages that made the run's tables."""
    names = names_in(folder) if names is None else names
    tables = sorted(name.removesuffix(".parquet") for name in names if name.endswith(".parquet"))
    made = (
        str(files.read_json(folder / f"{name}.json").get("stage", "")) for name in tables if f"{name}.json" in names
    )
    return list(dict.fromkeys(made))


def names_in(folder: Place) -> set[str]:
    """Names of the files in a folder; an empty set where the folder does not exist."""
    return {place.name for place in folder.iterdir()} if folder.is_dir() else set()
