"""The JSON document of investigate: keys that other programs read. A NotRequired key may be missing."""

from typing import Annotated, NotRequired

from typing_extensions import TypedDict

from pipelines.diagnosis.documents import DiagnosisDocument, NextMeasurement


class InquiryMinutes(TypedDict):
    """Station time, min."""

    first_run: float
    follow_ups: float
    budget: Annotated[float, "allowed for follow-ups"]
    share: Annotated[float, "follow-ups over the first run"]


class InquiryRound(TypedDict):
    """A follow-up measurement and its diagnosis."""

    run: str
    why: Annotated[list[str], "effects that it separates"]
    next_measurements: list[NextMeasurement]
    planned_minutes: float
    minutes: float
    begun_before: Annotated[bool, "it went on from an earlier start"]


class InquiryDocument(DiagnosisDocument):
    """``investigate --json``: a lot measured, diagnosed, and measured on until the effects are separated."""

    run: Annotated[str, "the first run"]
    runs: Annotated[list[str], "the first run and its follow-ups"]
    ended: Annotated[str, "`adequate`, `told_apart`, `asked`, `declined`, `budget` or another reason to stop"]
    text: Annotated[str, "why it ended, as a sentence"]
    minutes: InquiryMinutes
    rounds: list[InquiryRound]
    command: NotRequired[Annotated[str | None, "command that continues it; null where nothing is left to approve"]]
