"""Connections of a real server on loopback: idle ones shut nobody out, and nobody holds one without asking."""

import asyncio
import socket
import ssl
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import uvicorn

from pipelines.serving.connections import ConnectionLimits, Connections, LimitedSocket, TimedRequests, listening_socket

QUICK = ConnectionLimits(most=20, idle_s=0.6, body_s=0.6, answer_s=0.6, long_s=0.3)
GET = b"GET %b HTTP/1.1\r\nhost: x\r\n\r\n"
LARGE = 30_000_000


async def pages(scope: Any, receive: Any, send: Any) -> None:
    """/ a short answer · /stream one without end · /large one of 30 MB · POST: the length of the body."""
    if scope["type"] == "lifespan":
        return
    size = 0
    if scope["method"] == "POST":
        message: Any = {"more_body": True}
        while message.get("more_body"):
            message = await receive()
            size += len(message.get("body", b""))
    await send({"type": "http.response.start", "status": 200, "headers": []})
    if scope["path"] == "/stream":
        while (await asyncio.wait_for(receive(), 30.0))["type"] != "http.disconnect":
            await send({"type": "http.response.body", "body": b"a", "more_body": True})
        return
    if scope["path"] == "/large":
        for _ in range(300):
            await send({"type": "http.response.body", "body": bytes(LARGE // 300), "more_body": True})
    await send({"type": "http.response.body", "body": b"%d" % size})


@contextmanager
def served(limits: ConnectionLimits = QUICK, **tls: Any) -> Iterator[LimitedSocket]:
    place = listening_socket("127.0.0.1", 0, "test", limits)
    app = TimedRequests(pages, place.connections)
    server = uvicorn.Server(uvicorn.Config(app, log_level="error", lifespan="off", timeout_graceful_shutdown=1, **tls))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [place]})
    thread.start()
    try:
        until(lambda: server.started)
        yield place
    finally:
        server.should_exit = True
        thread.join(20.0)
        place.close()
    assert not thread.is_alive()


def until(true: Any, patience_s: float = 15.0) -> None:
    end = time.monotonic() + patience_s
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def connected(place: LimitedSocket, content: bytes = b"") -> socket.socket:
    client = socket.create_connection(place.getsockname(), timeout=15.0)
    client.sendall(content)
    return client


def status(client: socket.socket) -> bytes:
    """The status of an answer; empty where the connection ended without one."""
    try:
        return client.recv(4096)[9:12]
    except ConnectionResetError:
        return b""


def ended(client: socket.socket) -> bool:
    """Whether the server ended the connection within 15 s."""
    with suppress(ConnectionResetError):
        while client.recv(65536):
            pass
    return True


def crowd(place: LimitedSocket, count: int, within: ExitStack, content: bytes = b"") -> list[socket.socket]:
    return [within.enter_context(connected(place, content)) for _ in range(count)]


def test_idle_connections_shut_nobody_out() -> None:
    with served(ConnectionLimits(most=20)) as place, ExitStack() as within:
        idle = crowd(place, 50, within, b"") + crowd(place, 50, within, b"GET / HTTP/1.1\r\nhost:")
        for _ in range(5):
            assert status(within.enter_context(connected(place, GET % b"/"))) == b"200"
        assert ended(idle[0])
        assert len([one for one in place.connections.open.values() if one.socket.fileno() >= 0]) <= 25


SILENT = (b"", b"GET / HTTP/1.1\r\n", b"POST / HTTP/1.1\r\nhost: x\r\ncontent-length: 9\r\n\r\n1234")


@pytest.mark.parametrize("content", SILENT, ids=["silent", "half a head", "half a body"])
def test_a_connection_that_says_no_more_is_closed(content: bytes) -> None:
    with served() as place, connected(place, content) as client:
        begin = time.monotonic()
        assert ended(client)
        assert time.monotonic() - begin < 5.0


def test_a_head_that_comes_letter_by_letter_is_not_waited_for() -> None:
    def drips(client: socket.socket) -> None:
        for _ in range(200):
            client.sendall(b"x")
            time.sleep(0.05)

    with served() as place, connected(place, b"GET / HTTP/1.1\r\n") as client, pytest.raises(ConnectionError):
        drips(client)


def test_a_client_that_takes_nothing_of_its_answer_is_closed() -> None:
    with served() as place, connected(place, GET % b"/large"):
        until(lambda: place.connections.open)
        until(lambda: all(one.socket.fileno() < 0 for one in place.connections.open.values()))


def test_a_slow_client_gets_its_whole_answer() -> None:
    """The server is ready with it long before: what the system still has to send is no idleness."""
    with served() as place, connected(place, GET % b"/large") as client:
        size = 0
        while size < LARGE:
            part = client.recv(1_000_000)
            assert part, f"ended after {size} bytes"
            size += len(part)
            time.sleep(0.03)


def test_where_all_are_busy_the_oldest_stream_makes_room_or_the_new_connection_is_refused_in_words() -> None:
    for long_s in (60.0, 0.2):
        with served(ConnectionLimits(most=5, long_s=long_s)) as place, ExitStack() as within:
            streams = crowd(place, 5, within, GET % b"/stream")
            assert all(status(one) == b"200" for one in streams)
            if long_s == 60.0:
                text = within.enter_context(connected(place)).recv(4096)
                assert text.startswith(b"HTTP/1.1 503 ")
                assert b"too many connections; close some pages" in text
            else:
                time.sleep(0.4)
                assert status(within.enter_context(connected(place, GET % b"/"))) == b"200"
                assert ended(streams[0])


def test_one_other_machine_has_a_part_of_the_connections_only() -> None:
    async def asked() -> None:
        connections = Connections(ConnectionLimits(most=20, of_one_address=4))
        with ExitStack() as within:
            sockets = [within.enter_context(socket.socket()) for _ in range(9)]
            assert all(connections.admit(sockets[k], ("192.0.2.1", k)) for k in range(4))
            assert connections.admit(sockets[4], ("192.0.2.2", 1))
            assert connections.admit(sockets[5], ("192.0.2.1", 5))  # in place of its oldest idle one
            assert [one.address for one in connections.open.values() if one.shut_at] == ["192.0.2.1"]
            for one in connections.open.values():
                one.begin(lasting=True)
            assert not connections.admit(sockets[6], ("192.0.2.1", 6))
            assert connections.admit(sockets[7], ("192.0.2.3", 7))
            assert connections.admit(sockets[8], ("127.0.0.1", 8))

    asyncio.run(asked())


def test_connections_that_never_shake_hands_shut_nobody_out(tmp_path: Path) -> None:
    files = [str(tmp_path / name) for name in ("key.pem", "cert.pem")]
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-subj", "/CN=x",
         "-keyout", files[0], "-out", files[1]], check=True, capture_output=True,
    )  # fmt: skip
    context = ssl.create_default_context(cafile=files[1])
    context.check_hostname = False
    limits = ConnectionLimits(most=20, plain=False)
    with served(limits, ssl_keyfile=files[0], ssl_certfile=files[1]) as place, ExitStack() as within:
        crowd(place, 60, within)
        with context.wrap_socket(connected(place)) as client:
            client.sendall(GET % b"/")
            assert status(client) == b"200"
    limits = ConnectionLimits(idle_s=0.6, plain=False)
    with served(limits, ssl_keyfile=files[0], ssl_certfile=files[1]) as place, connected(place) as client:
        assert ended(client)


def test_the_limit_is_below_that_of_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("resource.getrlimit", lambda kind: (256, 4096))
    assert ConnectionLimits().fitting == 128
    monkeypatch.setattr("resource.getrlimit", lambda kind: (4096, 4096))
    assert ConnectionLimits().fitting == ConnectionLimits().most == 512
