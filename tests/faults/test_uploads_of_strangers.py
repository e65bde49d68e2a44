"""Uploads from strangers: looks at a file take little of the server, bodies are small, and what arrives goes to the disk."""

import asyncio
import gzip
import os
import threading
from pathlib import Path

import numpy as np
import psutil
import pytest
from asgi_client import AsgiClient

from pipelines.importers import limited
from pipelines.workbench.application import create_app
from pipelines.workbench.services import uploads
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import UploadPage
from schemas.errors import TumblelineError

MB = 10**6
GIGABYTE = 1000 * MB


@pytest.fixture
def settings(tmp_path: Path) -> WorkbenchSettings:
    return WorkbenchSettings(archive=str(tmp_path / "archive"), folder=tmp_path / "workbench")


def uploaded(settings: WorkbenchSettings, name: str, content: bytes) -> UploadPage:
    part = uploads.part_of(settings)
    part.write_bytes(content)
    return UploadPage(file=uploads.keep(settings, name, part))


class Memory(threading.Thread):
    """The largest memory of this process and its readers together, bytes, less that of this process before."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.most, self.before, self.ended = 0, 0, threading.Event()

    def run(self) -> None:
        process = psutil.Process(os.getpid())
        self.before = process.memory_info().rss
        while not self.ended.wait(0.02):
            total = process.memory_info().rss - self.before
            for child in process.children():
                try:  # servers and browsers of other tests are children too
                    total += child.memory_info().rss if limited.PROGRAM in child.cmdline() else 0
                except psutil.Error:
                    continue
            self.most = max(self.most, total)


def looks(settings: WorkbenchSettings, page: UploadPage, count: int) -> tuple[set[str], int]:
    """What looks at once say, and the memory that they take."""
    told: set[str] = set()

    def look() -> None:
        try:
            told.add(f"{uploads.reading(settings, page).rows} rows")
        except TumblelineError as problem:
            told.add(str(problem))

    memory = Memory()
    memory.start()
    threads = [threading.Thread(target=look) for _ in range(count)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    memory.ended.set()
    memory.join()
    return told, memory.most


def text_of(size: int) -> bytes:
    rng = np.random.default_rng(1)
    rows = "".join(
        f"{k / 100:.3f},{x:.6f},{y:.6f},{z:.6f}\n" for k, (x, y, z) in enumerate(rng.normal(size=(20_000, 3)))
    )
    return b"time_s,ax,ay,az\n" + (rows.encode() * (size // len(rows) + 1))[:size].rpartition(b"\n")[0]


LINES = {
    "commas": (b",,,,\n", 12),
    "lines without a cell, packed": (b"\n", 60),
    "rows, packed": (b"1,2\n", 60),
    "rows": (b"1,2,3,4\n", 64),
    "cells": (b"1\n", 64),
    "lines without a cell": (b"\n", 64),
    "quotes": (b'"a,b",c\n', 64),
    "wide rows": (b"1," * 4999 + b"1\n", 64),
    "quotes that stay open": (b'a"\n', 64),
}
"""A line that a file has again and again, and how many megabytes of it; all but the first are of the slow suite."""


@pytest.mark.slow
@pytest.mark.parametrize("name", LINES)
def test_twenty_looks_at_once_take_less_than_a_gigabyte(settings: WorkbenchSettings, name: str) -> None:
    line, megabytes = LINES[name]
    content, packed = line * (megabytes * MB // len(line)), name.endswith("packed")
    page = uploaded(settings, "a.csv.gz" if packed else "a.csv", gzip.compress(content, 9) if packed else content)
    told, memory = looks(settings, page, 20)
    assert len(told) == 1
    assert memory < GIGABYTE


@pytest.mark.slow
def test_twenty_looks_at_once_at_a_measured_record_of_64_mb_read_it(settings: WorkbenchSettings) -> None:
    told, memory = looks(settings, uploaded(settings, "a.csv", text_of(64 * MB)), 20)
    assert told
    assert all(text.endswith(" rows") for text in told)
    assert memory < GIGABYTE


def test_a_look_is_kept_until_the_file_changes(settings: WorkbenchSettings, monkeypatch) -> None:
    page, read = uploaded(settings, "a.csv", text_of(20_000)), list[Path]()
    limited_reader = uploads.in_reader
    monkeypatch.setattr(uploads, "in_reader", lambda *given: (read.append(given[3]), limited_reader(*given))[1])
    first = uploads.reading(settings, page)
    assert uploads.reading(settings, page) is first
    assert len(read) == 1
    Path(page.file).write_bytes(text_of(40_000))
    assert uploads.reading(settings, page).rows > first.rows
    assert len(read) == 2
    rows = "".join(f"{1.01 * x + 0.02},{0.001 * k},0.03,{x},0,0\n" for k in range(9) for x in (1, -1))
    Path(page.file).write_text(f"out_x [g],out_y [g],out_z [g],force_x,force_y,force_z\n{rows}", encoding="utf-8")
    assert "not read by this page" in uploads.reading(settings, page).open[-1]


def test_a_look_that_reaches_a_limit_says_how_to_import_the_file(settings: WorkbenchSettings, monkeypatch) -> None:
    page = uploaded(settings, "a.csv", text_of(20 * MB))
    limited.end()  # a process that has read before may have room left
    monkeypatch.setattr(uploads, "LOOK", limited.ReadingLimits(32 * limited.MIB, 60, 60))
    with pytest.raises(TumblelineError, match=r"a\.csv: .*memory.*tumbleline import .*a\.csv"):
        uploads.reading(settings, page)


def bench(settings: WorkbenchSettings) -> tuple[AsgiClient, dict[str, str]]:
    app = create_app(settings)
    return AsgiClient(app, settings.address), {"authorization": f"Bearer {settings.token}"}


def test_a_body_of_more_than_a_megabyte_is_refused_and_an_endless_one_where_it_becomes_too_large(
    settings: WorkbenchSettings,
) -> None:
    client, headers = bench(settings)
    answer = client.post("/jobs", content=b'{"a": "' + b"x" * 2 * MB + b'"}', headers=headers)
    assert answer.status_code == 413
    assert "more than 1000000 bytes" in answer.json()["problem"]
    assert client.post("/jobs", json={"a": "x" * 1000}, headers=headers).status_code == 422
    sent, told = [], []
    host = settings.address.partition("//")[2]
    scope = {"type": "http", "method": "POST", "path": "/jobs", "raw_path": b"/jobs", "query_string": b"", "scheme": "http",
             "headers": [(b"host", host.encode()), (b"authorization", f"Bearer {settings.token}".encode())],
             "http_version": "1.1", "server": None, "client": None, "root_path": ""}  # fmt: skip

    async def receive() -> dict:
        sent.append(1)
        return {"type": "http.request", "body": bytes(MB // 4), "more_body": True}

    async def send(message) -> None:
        told.append(message)

    asyncio.run(create_app(settings)(scope, receive, send))
    assert told[0]["status"] == 413
    assert len(sent) == 5


def test_an_upload_goes_to_the_disk_as_it_arrives_and_one_that_fails_leaves_nothing(
    settings: WorkbenchSettings,
) -> None:
    client, headers = bench(settings)
    answer = client.request("PUT", "/upload/file?name=a.csv", content=text_of(3 * MB), headers=headers)
    assert answer.status_code == 200
    folder = settings.folder / "uploads"
    assert [one.name for one in folder.iterdir()] == ["a.csv"]
    assert (folder / "a.csv").stat().st_size > 2 * MB
    for name, content in (("a.exe", b"x"), ("b.csv", b"")):
        assert client.request("PUT", f"/upload/file?name={name}", content=content, headers=headers).status_code == 422
    assert [one.name for one in folder.iterdir()] == ["a.csv"]
    assert "a.csv" in client.get("/upload", headers=headers).text
