"""The JSON document of lineage: keys that other programs read."""

from __future__ import annotations

from typing import Annotated, Any

from typing_extensions import TypedDict


class LineageNode(TypedDict):
    """A file, run or reference of a lineage."""

    id: str
    kind: str
    label: str
    file: Annotated[str, "below the archive's folder; empty: none"]
    sha256: str
    about: dict[str, Any]


class LineageStep(TypedDict):
    """A step that made things from other things."""

    id: str
    name: str
    used: Annotated[list[str], "ids"]
    made: Annotated[list[str], "ids"]
    about: dict[str, Any]


class LineageDocument(TypedDict):
    """``lineage UNIT|RUN|FILE --json``: origin and results of a unit, a run or a file."""

    target: str
    kind: str
    focus: Annotated[list[str], "ids of what was asked for"]
    things: list[LineageNode]
    steps: list[LineageStep]
    prov: Annotated[str | None, "the file of `--prov`; null: none"]
    crate: Annotated[str | None, "the folder of `--crate`; null: none"]
