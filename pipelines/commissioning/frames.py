"""A recording of the links of a station as a time line, a document, a page, and a test."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from pipelines.commissioning.documents import FrameRow, FramesDocument, RecordedDeviceRow
from pipelines.drawing import Chart, Plot, PlotAxis, Trace, still, svg_text
from pipelines.drawing.chart import Role, Symbol
from pipelines.report.templates import template
from stations.links.frames import EXCEPTION
from stations.recordings.clients_view import what_a_client_gets
from stations.recordings.decoding import said
from stations.recordings.frame_file import Exchange, FrameFile

MOST_MARKS = 20_000
Kind = Literal["read", "order", "refused", "no answer"]
KINDS: tuple[tuple[Kind, Role, Symbol, float], ...] = (
    ("read", "x", "circle", -0.24),
    ("order", "before", "triangle-up", -0.08),
    ("refused", "limit", "square", 0.08),
    ("no answer", "ink", "diamond", 0.24),
)
"""With the colour, the mark, and how far from the line of its device each kind is drawn."""


def kind_of(exchange: Exchange) -> Kind:
    """Whether an exchange is a read, an order, a refusal or a silence."""
    if exchange.reply is None:
        return "no answer"
    if not exchange.text and exchange.reply and exchange.reply[0] & EXCEPTION:
        return "refused"
    if exchange.text and exchange.reply.startswith(b"NA:"):
        return "refused"
    return "order" if exchange.writes else "read"


def timeline(recording: FrameFile) -> Chart:
    """Exchanges by device over time, and the time until each answer."""
    exchanges = _thinned(recording.exchanges)
    places = list(dict.fromkeys(recording.name_of(exchange) for exchange in exchanges))
    at, spent = [], []
    for kind, role, symbol, beside in KINDS:
        of_kind = [exchange for exchange in exchanges if kind_of(exchange) == kind]
        if not of_kind:
            continue
        time = np.array([exchange.at_s for exchange in of_kind])
        row = np.array([places.index(recording.name_of(exchange)) + beside for exchange in of_kind])
        texts = tuple(_told(recording, exchange) for exchange in of_kind)
        at.append(Trace(kind, time, row, role=role, symbol=symbol, size=7.0, texts=texts))
        if kind != "no answer":
            seconds = np.array([max(exchange.seconds, 1e-6) for exchange in of_kind]) * 1e3
            spent.append(Trace(kind, time, seconds, role=role, symbol=symbol, size=5.0, texts=texts, legend=False))
    last = max((exchange.at_s + exchange.seconds for exchange in exchanges), default=1.0)
    span = PlotAxis("time since the start of the recording / s", low=0.0, high=last or 1.0)
    plots = (
        Plot("exchanges", span, PlotAxis("", names=tuple(places)), tuple(at)),
        Plot("answer time", span, PlotAxis("time until the answer / ms", log=True), tuple(spent)),
    )
    left = len(recording.exchanges) - len(exchanges)
    note = (
        f"{left} of {len(recording.exchanges)} exchanges are not drawn; those without an answer all are" if left else ""
    )
    return Chart("Exchanges over time", plots, 1, height=max(220, 60 + 24 * len(places)), note=note)


def _thinned(exchanges: Sequence[Exchange]) -> list[Exchange]:
    """At most so many marks: orders, refusals and silences first, then evenly taken reads."""
    if len(exchanges) <= MOST_MARKS:
        return list(exchanges)
    reads = [k for k, exchange in enumerate(exchanges) if kind_of(exchange) == "read"]
    others = len(exchanges) - len(reads)
    step = -(-len(reads) // max(MOST_MARKS - others, MOST_MARKS // 10))
    left_out = set(reads) - set(reads[::step])
    return [exchange for k, exchange in enumerate(exchanges) if k not in left_out]


def _told(recording: FrameFile, exchange: Exchange) -> str:
    answer = said(exchange, recording.device_of(exchange))
    return f"{recording.name_of(exchange)}: {exchange.what} → {answer[:120]}, {1e3 * exchange.seconds:.1f} ms"


MOST_ROWS = 2_000


def devices_of(recording: FrameFile) -> list[RecordedDeviceRow]:
    """The devices of a recording with the number of their exchanges."""
    answers = [(recording.device_of(exchange), exchange.reply is None) for exchange in recording.exchanges]
    return [
        {
            "place": device.name,
            "link": device.link,
            "device_id": device.device_id,
            "profile": "" if device.profile is None else device.profile.name,
            "exchanges": sum(asked == device for asked, _ in answers),
            "no_answer": sum(asked == device and silent for asked, silent in answers),
        }
        for device in recording.devices
    ]


def frames_document(recording: FrameFile, limit: int | None = None) -> FramesDocument:
    """The document of a recording, with its last ``limit`` frames; all without one."""
    exchanges = recording.exchanges
    frames: list[FrameRow] = [
        {
            "at_s": exchange.at_s,
            "seconds": exchange.seconds,
            "place": recording.name_of(exchange),
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
    chart = still(svg_text(timeline(recording))) if recording.exchanges else ""
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
