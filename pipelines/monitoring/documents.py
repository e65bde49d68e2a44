"""The JSON documents of ``monitor``: keys that other programs read."""

from typing import Annotated

from typing_extensions import TypedDict


class HealthDocument(TypedDict):
    """``station monitor --json``: whether the line is healthy; also the answer of ``/healthz``."""

    ok: Annotated[bool, "no problem"]
    when: Annotated[str, "ISO date and time, UTC"]
    problems: Annotated[list[str], "one sentence for each, with what to do"]
    sources: Annotated[dict[str, bool], "archive, orchestrator, stations: whether it could be read"]


class Alert(TypedDict):
    """The document that is posted to the web hook."""

    source: Annotated[str, "always tumbleline"]
    kind: Annotated[str, "crashed, failed, missed, late, unsafe or audit"]
    id: Annotated[str, "the same for each attempt at delivery"]
    subject: Annotated[str, "run, station or finding"]
    text: Annotated[str, "one sentence"]
    when: Annotated[str, "ISO date and time, UTC"]
