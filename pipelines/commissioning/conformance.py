"""The conformance of a bring-up as document and page: per register and per promise of the family held, differs or not tried."""

from pathlib import Path

from pipelines.commissioning.documents import ConformanceDocument, Platform
from pipelines.commissioning.frames import timeline
from pipelines.drawing import still, svg_text
from pipelines.report.templates import template
from stations.bringup.session import BringUp
from stations.recordings.frame_file import read_frames

FORMAT = "tumbleline conformance 1"


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
        "points": findings.points,
        "answers": {
            "usual_ms": round(1e3 * bring_up.read.usual, 3),
            "slowest_ms": round(1e3 * bring_up.read.slowest, 3),
            "timeout_s": bring_up.timeout_s,
        },
        "left": bring_up.left,
        "recording": recording,
        "corrected_profile": corrected,
    }


SECTIONS = {"Reach": "reach", "Against the panel": "panel", "Orders": "order", "Registers": "register"}


def conformance_page(document: ConformanceDocument, recording: Path | None) -> str:
    """The page as one HTML text without other files."""
    chart = ""
    if recording is not None and recording.is_file():
        content = read_frames(recording)
        chart = still(svg_text(timeline(content))) if content.exchanges else ""
    sections = [("What differs", [point for point in document["points"] if point.verdict == "differs"])]
    for title, part in SECTIONS.items():
        sections.append((title, [point for point in document["points"] if point.part == part]))
    return template("conformance.html").render(d=document, sections=sections, chart=chart)
