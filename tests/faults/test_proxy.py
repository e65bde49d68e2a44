"""The bad network does to frames what it is told, and nothing else."""

import socket
from contextlib import contextmanager, suppress

from each import each
from small_server import answering

from stations.plant.faults.proxy import ChaosProxy, WireAction, split

PATIENCE_S = 10.0
"""For what arrives; a busy machine takes its time."""
SILENCE_S = 0.2
"""After which nothing more is taken to arrive."""
REPLY = b"\x00\x2a\x00\x00\x00\x07\x01\x03\x04\x11\x11\x22\x22"


def frame(number: int, body: bytes = b"\x01\x03\x04\x11\x11\x22\x22") -> bytes:
    return number.to_bytes(2, "big") + b"\x00\x00" + len(body).to_bytes(2, "big") + body


@contextmanager
def through(*actions: WireAction):
    """A proxy, and a client that speaks through it to a server that answers every frame with itself."""
    with answering(lambda frame: frame) as (address, _), ChaosProxy(*address) as proxy:
        proxy.once(*actions)
        with socket.create_connection((proxy.host, proxy.port), timeout=PATIENCE_S) as client:
            yield proxy, client


def received(client: socket.socket, size: int) -> bytes:
    """So many bytes that arrive, and what comes behind them within a moment."""
    data = b""
    client.settimeout(PATIENCE_S)
    while len(data) < size and (more := client.recv(4096)):
        data += more
    client.settimeout(SILENCE_S)
    with suppress(TimeoutError):
        data += client.recv(4096)
    return data


@each(
    [
        (WireAction("drop"), b""),
        (WireAction("drop", "request"), b""),
        (WireAction("delay", delay_s=0.05), frame(1)),
        (WireAction("duplicate"), frame(1) * 2),
        (WireAction("truncate", size=3), frame(1)[:-3]),
        (WireAction("half_open"), b""),
        (WireAction("late"), b""),
        (WireAction("retag"), frame(2)),
        (WireAction("swap"), frame(1, b"\x01\x03\x04\x22\x22\x11\x11")),
    ]
)
def test_the_next_frame_is_spoilt_as_asked(row):
    action, arrives = row
    with through(action) as (proxy, client):
        client.sendall(frame(1))
        assert received(client, len(arrives)) == arrives
    assert proxy.applied == [action]


def test_a_late_reply_comes_in_front_of_the_next_one_on_a_new_connection():
    with through(WireAction("late")) as (proxy, client):
        client.sendall(frame(1))
        assert received(client, 0) == b""
        with socket.create_connection((proxy.host, proxy.port), timeout=PATIENCE_S) as again:
            again.sendall(frame(2))
            assert received(again, 26) == frame(1) + frame(2)


def test_streams_are_cut_at_frames():
    assert split(REPLY + REPLY[:5]) == ([REPLY], REPLY[:5])
