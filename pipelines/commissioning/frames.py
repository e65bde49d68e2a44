"""A recording as a document, a page, and a test."""

from __future__ import annotations

import json
from pathlib import Path

from pipelines.commissioning.documents import FrameRow, FramesDocument, RecordedDeviceRow
from pipelines.commissioning.frame_pictures import kind_of, timeline
from pipelines.drawing import svg_text
from pipelines.report.templates import template
from stations.recordings.clients_view import what_a_client_gets
from stations.recordings.decoding import said
from stations.recordings.frame_file import FrameFile

MOST_ROWS = 2_000


def devices_of(recording: FrameFile) -> list[RecordedDeviceRow]:
    """The devices of a recording with the number of their exchanges."""
    rows: list[RecordedDeviceRow] = []
    for device in recording.devices:
        own = [exchange for exchange in recording.exchanges if recording.device_of(exchange) == device]
        rows.append(
            {
                "place": device.place,
                "link": device.link,
                "device_id": device.device_id,
                "profile": "" if device.profile is None else device.profile.name,
                "exchanges": len(own),
                "no_answer": sum(exchange.reply is None for exchange in own),
            }
        )
    return rows


def frames_document(recording: FrameFile, limit: int | None = None) -> FramesDocument:
    """The document of a recording, with its last ``limit`` frames; all without one."""
    exchanges = recording.exchanges
    frames: list[FrameRow] = [
        {
            "at_s": exchange.at_s,
            "seconds": exchange.seconds,
            "place": recording.place_of(exchange),
            "kind": kind_of(exchange),
            "what": exchange.what,
            "answer": said(exchange, recording.device_of(exchange)),
            "request_hex": exchange.request.hex(),
            "reply_hex": None if exchange.reply is None else exchange.reply.hex(),
        }
        for exchange in (exchanges if limit is None else exchanges[-limit:])
    ]
    return {
        "recording": recording.name,
        "made": recording.made,
        "purpose": recording.purpose,
        "remark": recording.remark,
        "devices": devices_of(recording),
        "frames": frames,
    }


def frames_page(recording: FrameFile) -> str:
    """The recording as one page that needs no network: its time line, its devices and its last frames."""
    document = frames_document(recording, MOST_ROWS)
    chart = svg_text(timeline(recording)) if recording.exchanges else ""
    return template("frames.html").render(document=document, chart=chart, total=len(recording.exchanges))


def as_test(path: Path, name: str) -> str:
    """A test that holds the client to what it gets from the recording ``path``, which lies beside the test as ``name``."""
    expected = "\n".join(f"    {json.dumps(line, ensure_ascii=False)}," for line in what_a_client_gets(path))
    return f'''"""What a recorded device answered, and what the client makes of it.

Where EXPECTED shows a defect, correct it here and mend the client.
"""

from pathlib import Path

from stations.recordings.clients_view import what_a_client_gets

EXPECTED = [
{expected}
]


def test_what_a_client_gets_from_the_recorded_device():
    assert what_a_client_gets(Path(__file__).with_name({name!r})) == EXPECTED
'''
