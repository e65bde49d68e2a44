"""The conformance document of a bring-up as a page and as lines for a terminal."""

from __future__ import annotations

from pathlib import Path

from pipelines.commissioning.documents import ConformanceDocument, ConformancePoint
from pipelines.commissioning.frame_pictures import timeline
from pipelines.drawing import svg_text
from pipelines.report.templates import template
from stations.recordings.frame_file import read_frames

SECTIONS = (
    ("What differs", None),
    ("Reach", "reach"),
    ("Against the panel", "panel"),
    ("Orders", "order"),
    ("Registers", "register"),
)


def conformance_page(document: ConformanceDocument, recording: Path | None) -> str:
    """The page as one HTML text without other files."""
    chart = ""
    if recording is not None and recording.is_file():
        content = read_frames(recording)
        chart = svg_text(timeline(content)) if content.exchanges else ""
    sections = [(title, _of(document, part)) for title, part in SECTIONS]
    return template("conformance.html").render(d=document, sections=sections, chart=chart)


def _of(document: ConformanceDocument, part: str | None) -> list[ConformancePoint]:
    if part is None:
        return [point for point in document["points"] if point["verdict"] == "differs"]
    return [point for point in document["points"] if point["part"] == part]
