"""A device that is spoken to in lines, when it is slow, says nothing, says too much, or hangs up."""

import socket
from contextlib import contextmanager
from types import SimpleNamespace

import pytest
from each import each
from small_server import answering

from schemas.errors import LinkLost, StationRefused, StationTimeout
from stations.links import lines
from stations.links.lines import LineLink

PATIENCE_S = 10.0
"""For answers that come; a busy machine takes its time."""
SILENCE_S = 1.0
"""For answers of which one does not come and the next does."""


@contextmanager
def linked(*answers: bytes | None, attempts: int = 2, timeout_s: float = PATIENCE_S):
    """A link to a device that gives these answers in turn, None hangs up; and what the device hears."""
    left = list(answers)
    with answering(lambda _: left.pop(0) if left else b"") as (address, heard):
        link = LineLink(lines.TcpLines(*address, timeout_s), read_attempts=attempts)
        try:
            yield link, heard
        finally:
            link.close()


def test_questions_are_put_again_after_silence_and_orders_are_not():
    with linked(b"", b"23.0,23.0,180.0,-70.0\r\n", timeout_s=SILENCE_S) as (link, heard):
        assert link.ask("TEMP?", "air") == "23.0,23.0,180.0,-70.0"
        assert heard == [b"TEMP?\r\n"] * 2
    with linked(b"", timeout_s=0.2) as (link, heard):
        with pytest.raises(StationTimeout, match=r"no answer to set point 'TEMP, S25.0' in 0\.2 s"):
            link.tell("TEMP, S25.0", "set point")
        assert heard == [b"TEMP, S25.0\r\n"]


@each([None, b"23.0\r\n40.0\r\n", b"\xff\xfe\r\n", b"x" * 3000])
def test_what_is_not_one_line_is_no_answer(answer):
    with linked(answer, attempts=1) as (link, _), pytest.raises(LinkLost, match="connection lost at air 'TEMP\\?'"):
        link.ask("TEMP?", "air")


def test_an_answer_without_an_end_costs_one_time_out(monkeypatch):
    readings = iter([0.0, 0.0, PATIENCE_S + 0.1])  # of the clock: at the question, before a part arrives, and after it
    monkeypatch.setattr(lines, "time", SimpleNamespace(monotonic=lambda: next(readings)))
    with linked(b"23.", attempts=1) as (link, _), pytest.raises(StationTimeout):
        link.ask("TEMP?", "air")
    assert list(readings) == []


def test_a_late_answer_never_meets_the_next_question():
    with linked(b"", b"25.0\r\n", attempts=1, timeout_s=SILENCE_S) as (link, _):
        with pytest.raises(StationTimeout):
            link.ask("TEMP?", "air")
        assert link.ask("MODE?", "mode") == "25.0"  # on a connection of its own


def test_refusals_and_that_nobody_is_there_are_told():
    with linked(b"NA:DATA OUT OF RANGE\r\n") as (link, _), pytest.raises(StationRefused, match="NA:DATA OUT OF RANGE"):
        link.tell("TEMP, S999.0", "set point")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(LinkLost, match="connection lost"):
        LineLink(lines.TcpLines("127.0.0.1", port, 0.2), read_attempts=1).ask("TEMP?", "air")
