"""Attributes from files, and their list."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import pandas as pd

from pipelines.archive import Archive
from pipelines.discovery.attributes import By, add_attributes, known_attributes, sentences
from pipelines.discovery.documents import AddedAttributes, KnownAttribute, ListedAttributes
from schemas.errors import WrongUse

_SHOWN = 4


def added_from(archive: Archive, path: Path, by: str) -> tuple[AddedAttributes, list[str]]:
    """What a file adds, and the same in sentences.

    Raises
    ------
    WrongUse
        The file is none, or not a table.
    """
    if by not in {"serial", "run"}:
        raise WrongUse(f"attributes: --by is '{by}', serial or run is needed")
    if not path.is_file():
        raise WrongUse(f"attributes: there is no file {path}; give a .csv or .parquet file")
    try:
        if path.suffix.lower() == ".parquet":
            table = pd.read_parquet(path)
        else:
            table = pd.read_csv(path, dtype=str, keep_default_na=False)
    except (
        ValueError,
        OSError,
        UnicodeDecodeError,
    ) as problem:  # pandas' and Arrow's errors of a file are of these kinds
        raise WrongUse(
            f"attributes: {path} is no table ({str(problem).splitlines()[0]}); give a .csv or .parquet file"
        ) from None
    added = add_attributes(archive, table, cast("By", by), path.name)
    return added, sentences(added)


def listed(archive: Archive) -> ListedAttributes:
    """Every attribute: of units or runs, for how many it is known, how many levels it has, some of them."""
    known = known_attributes(archive)
    rows: list[KnownAttribute] = []
    for kind, of in (("units", known.serial), ("runs", known.run)):
        names = dict.fromkeys(name for values in of.values() for name in values)
        for name in names:
            values = [own[name] for own in of.values() if name in own]
            levels = sorted(set(values))
            some = ", ".join(levels[:_SHOWN]) + (", …" if len(levels) > _SHOWN else "")
            rows.append({"attribute": name, "of": kind, "known": len(values), "levels": len(levels), "such_as": some})
    return {"attributes": rows}
