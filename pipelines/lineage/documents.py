"""The JSON document of lineage: keys that other programs read."""

from typing import Annotated

from typing_extensions import TypedDict

from pipelines.lineage.graph import Node, ProvActivity


class LineageDocument(TypedDict):
    """``lineage UNIT|RUN|FILE --json``: origin and results of a unit, a run or a file."""

    target: str
    kind: str
    focus: Annotated[list[str], "ids of what was asked for"]
    things: list[Node]
    steps: list[ProvActivity]
    prov: Annotated[str | None, "the file of `--output`; null: none"]
    crate: Annotated[str | None, "the folder of `--output`; null: none"]
