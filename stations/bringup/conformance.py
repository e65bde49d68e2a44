"""The conformance document of a bring-up: per register and per promise of the family held, differs or not tried."""

from pathlib import Path
from typing import Annotated, Literal

from typing_extensions import TypedDict

from schemas.errors import DataRejected
from schemas.foreign import foreign
from stations.bringup.person import Verdict
from stations.bringup.session import BringUp

FORMAT = "tumbleline conformance 1"
Platform = Literal["hardware", "simulator", "replay", "not stated"]


class ConformancePoint(TypedDict):
    """One register, or one promise."""

    part: Annotated[str, "reach, register, panel, order or link"]
    what: str
    verdict: Verdict
    found: str
    expected: str
    remedy: str


class AnswerTimes(TypedDict):
    """How long answers took."""

    usual_ms: float
    slowest_ms: float
    timeout_s: Annotated[float, "time-out that the bring-up used"]


class ConformanceDocument(TypedDict):
    """What a bring-up has found."""

    format: str
    profile: str
    maker: str
    model: str
    verified_on: Annotated[Platform, "what the person said is at the other end"]
    by: Annotated[str, "who did it; empty if not stated"]
    made: str
    link: Annotated[str, "tcp, tls, rtu, ascii or visa"]
    device_id: int
    complete: Annotated[bool, "false: it ended before its last step"]
    ended: Annotated[str, "why it ended early"]
    held: int
    differs: int
    not_tried: int
    points: list[ConformancePoint]
    answers: AnswerTimes
    left: Annotated[list[str], "what was done to leave the device as it was found"]
    recording: Annotated[str, "name of the file with every frame"]
    corrected_profile: Annotated[str, "name of the profile with corrected rows; empty if none is needed"]


def document_of(
    bring_up: BringUp, *, verified_on: Platform, by: str, recording: str, corrected: str
) -> ConformanceDocument:
    """The document of a bring-up, ended or not. It has no address: the page is passed on."""
    findings, profile = bring_up.findings, bring_up.profile
    return {
        "format": FORMAT,
        "profile": profile.name,
        "maker": profile.maker,
        "model": profile.model,
        "verified_on": verified_on,
        "by": by,
        "made": bring_up.made,
        "link": bring_up.target.link.device.link,
        "device_id": bring_up.target.link.device.device_id,
        "complete": not bring_up.ended,
        "ended": bring_up.ended,
        "held": findings.count("held"),
        "differs": findings.count("differs"),
        "not_tried": findings.count("not tried"),
        "points": [
            {
                "part": p.part,
                "what": p.what,
                "verdict": p.verdict,
                "found": p.found,
                "expected": p.expected,
                "remedy": p.remedy,
            }
            for p in findings.points
        ],
        "answers": {
            "usual_ms": round(1e3 * bring_up.read.usual, 3),
            "slowest_ms": round(1e3 * bring_up.read.slowest, 3),
            "timeout_s": bring_up.timeout_s,
        },
        "left": bring_up.left,
        "recording": recording,
        "corrected_profile": corrected,
    }


def read_conformance(path: Path) -> ConformanceDocument:
    """A conformance document from its file.

    Raises
    ------
    DataRejected
        The file is not of the format.
    """
    from pydantic import TypeAdapter  # noqa: PLC0415 - only for files that somebody sent

    with foreign(f"conformance: {path}", "a file that 'tumbleline station bring-up' wrote is needed"):
        document = TypeAdapter(ConformanceDocument).validate_json(path.read_bytes())
    if document["format"] != FORMAT:
        raise DataRejected(
            f"conformance: {path} has format '{document['format'][:40]}', '{FORMAT}' is needed; update the product"
        )
    return document
