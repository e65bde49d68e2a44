"""The workbench as a process of its own, asked by raw sockets: from this machine, through proxies, and by a crowd."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import TOKEN, Served, served
from in_process import refused


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("served")
    with served(folder / "archive", folder / "bench") as one:
        yield one


def answer(bench: Served, *lines: str, path: str = "/units", protocol: str = "HTTP/1.1", host: str = "") -> str:
    """The whole answer to a request."""
    head = [f"GET {path} {protocol}", f"host: {host or f'127.0.0.1:{bench.port}'}", "connection: close", *lines, "", ""]
    parts = []
    with socket.create_connection(("127.0.0.1", bench.port), timeout=30.0) as client:
        client.sendall("\r\n".join(head).encode())
        while part := client.recv(65536):
            parts.append(part)
    return b"".join(parts).decode()


def status(text: str) -> int:
    return int(text.split(" ", 2)[1])


def test_this_machine_reads_without_the_token_and_a_proxy_on_it_does_not(bench: Served) -> None:
    assert status(answer(bench)) == 200
    assert status(answer(bench, host=f"localhost:{bench.port}")) == 200
    for line in ("X-Forwarded-For: 192.0.2.1", "Forwarded: for=192.0.2.1", "Via: 1.1 proxy", "X-Real-IP: 127.0.0.1"):
        assert status(answer(bench, line)) == 403, line
        assert status(answer(bench, line, f"Authorization: Bearer {TOKEN}")) == 200, line
    assert status(answer(bench, protocol="HTTP/1.0")) == 403
    assert status(answer(bench, host="bench.example")) == 403


def test_the_address_gives_a_session_for_this_port_and_leads_nowhere_else(bench: Served) -> None:
    entered = answer(bench, path=f"/units?token={TOKEN}")
    assert status(entered) == 303
    assert "\r\nlocation: /units#change=" in entered
    assert TOKEN not in entered
    cookie = entered.split("set-cookie: ")[1].split(";")[0]
    proxied = "X-Forwarded-For: 192.0.2.1"
    assert status(answer(bench, proxied, f"cookie: {cookie}")) == 200
    assert status(answer(bench, proxied, f"cookie: {cookie}", host=f"localhost:{bench.port}")) == 403
    assert status(answer(bench, proxied, f"authorization: Bearer {cookie.partition('=')[2]}")) == 403
    for path in ("//evil.example", "/\\evil.example", "/%5cevil.example", "http://evil.example/"):
        text = answer(bench, path=f"{path}?token={TOKEN}")
        assert status(text) == 400, path
        assert "location:" not in text


def test_a_token_that_can_be_guessed_ends_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TUMBLELINE_WORKBENCH_TOKEN", "secret")
    told = refused("workbench", tmp_path / "archive", "--port", "0")
    assert "a token of 6 characters" in told
    assert "at least 128 bits is needed" in told
