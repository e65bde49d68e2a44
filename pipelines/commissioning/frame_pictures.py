"""A recording of a station's links as a time line: who was asked what, when, and how long the answer took."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from pipelines.drawing import Chart, Plot, PlotAxis, Trace
from pipelines.drawing.chart import Role, Symbol
from stations.links.frames import EXCEPTION
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
    places = list(dict.fromkeys(recording.place_of(exchange) for exchange in exchanges))
    at, spent = [], []
    for kind, role, symbol, beside in KINDS:
        own = [exchange for exchange in exchanges if kind_of(exchange) == kind]
        if not own:
            continue
        time = np.array([exchange.at_s for exchange in own])
        row = np.array([places.index(recording.place_of(exchange)) + beside for exchange in own])
        texts = tuple(_told(recording, exchange) for exchange in own)
        at.append(Trace(kind, time, row, role=role, symbol=symbol, size=7.0, texts=texts))
        if kind != "no answer":
            seconds = np.array([max(exchange.seconds, 1e-6) for exchange in own]) * 1e3
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
    return f"{recording.place_of(exchange)}: {exchange.what} → {answer[:120]}, {1e3 * exchange.seconds:.1f} ms"
