"""Uploads, certificates and archives from strangers take little of the server, end no command, and lead nowhere else."""

import asyncio
import gzip
import json
import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import psutil
import pytest
from asgi_client import AsgiClient
from capture_double import finished_run
from each import each
from in_process import given
from typer.testing import CliRunner

from pipelines.archive import Archive
from pipelines.archive.backup import copy_archive
from pipelines.certificates.document.signature_check import SignatureBroken, canonical, parsed
from pipelines.cli import app
from pipelines.importers import limited
from pipelines.workbench.application import create_app
from pipelines.workbench.services import uploads
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import UploadPage
from schemas.errors import ArchiveUnusable, TumblelineError

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
    with ThreadPoolExecutor(count) as threads:
        for _ in range(count):
            threads.submit(look)
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
"""A line that a file has again and again, and how many megabytes of it."""


@pytest.mark.slow
@pytest.mark.parametrize("name", [*LINES, "a measured record"])
def test_twenty_looks_at_once_take_less_than_a_gigabyte(settings: WorkbenchSettings, name: str) -> None:
    line, megabytes = LINES[name] if name in LINES else (text_of(64 * MB), 64)
    content, packed = line * (megabytes * MB // len(line)), name.endswith("packed")
    page = uploaded(settings, "a.csv.gz" if packed else "a.csv", gzip.compress(content, 9) if packed else content)
    told, memory = looks(settings, page, 20)
    assert len(told) == 1
    assert name in LINES or told.pop().endswith(" rows")
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
    head = {"host": settings.address.partition("//")[2], **headers}
    scope = {"type": "http", "method": "POST", "path": "/jobs", "raw_path": b"/jobs", "query_string": b"", "scheme": "http",
             "headers": [(name.encode(), value.encode()) for name, value in head.items()],
             "http_version": "1.1", "server": None, "client": None, "root_path": ""}  # fmt: skip

    async def receive() -> dict:
        sent.append(1)
        return {"type": "http.request", "body": bytes(MB // 4), "more_body": True}

    async def send(message) -> None:
        told.append(message)

    asyncio.run(create_app(settings)(scope, receive, send))
    assert (told[0]["status"], len(sent)) == (413, 5)


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


# -- certificates and archives: no XML, JSON or link keeps a command busy, ends it, or leads elsewhere --------------------


DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
REAL = "<si:real><si:value>1</si:value><si:unit>\\one</si:unit></si:real>"
SECRET = "root:x:0:0: a file of the system"


def document(inside: str, more: str = "") -> bytes:
    head = f'<dcc:digitalCalibrationCertificate xmlns:dcc="{DCC}" xmlns:si="{SI}" schemaVersion="3.0.0"{more}>'
    return f"{head}{inside}</dcc:digitalCalibrationCertificate>".encode()


def result(inside: str, name: str = "a") -> str:
    return f"<dcc:result><dcc:name><dcc:content>{name}</dcc:content></dcc:name>{inside}</dcc:result>"


def nested(count: int, inside: str) -> str:
    return "<dcc:result>" * count + inside + "</dcc:result>" * count


SLOW = {
    "one name for all numbers": document(result("<si:real/>" * 28_000)),
    "numbers beside one another": document(result("<dcc:name/>" + REAL * 4400)),
    "results in one another": document(nested(200, REAL * 4200)),
    "digits": document(result(f"<si:real><si:value>{'1' * 290_000}x</si:value></si:real>")),
    "namespaces": document("", "".join(f' xmlns:n{k}="u:{k}" n{k}:a=""' for k in range(9000))),
    "attributes": document("", "".join(f' a{k}=""' for k in range(30_000))),
}


@each(SLOW)
def test_300_kb_of_xml_keep_verify_busy_for_seconds_at_most(name: str, tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_bytes(SLOW[name])
    before = time.process_time()
    status, out, _ = given("verify", tmp_path / "a.xml", "--json")
    assert time.process_time() - before < 6.0
    assert (status, json.loads(out)["accepted"]) == (1, False)


def test_a_damaged_namespace_is_a_sentence_and_a_verdict_and_too_little_memory_is_none(
    tmp_path: Path, monkeypatch
) -> None:
    damaged, words = document("", ' xmlns:n="relative"'), "it has no canonical form"
    with pytest.raises(SignatureBroken, match=f"{words} .* a namespace in it is not an absolute address"):
        canonical(parsed(damaged))
    (tmp_path / "a.xml").write_bytes(damaged)
    status, out, _ = given("verify", tmp_path / "a.xml")
    assert (status, "no canonical form" in out) == (1, True)

    def full(*_: object) -> None:
        raise MemoryError

    (tmp_path / "a.pdf").write_bytes(b"%PDF-1.7")
    monkeypatch.setattr("pyhanko.pdf_utils.reader.PdfFileReader", full)
    status, _, message = given("verify", tmp_path / "a.pdf")
    assert (status, "needs more memory than is available" in message) == (2, True)


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    run = finished_run(tmp_path)
    run.seal()
    return run.archive


def test_audit_names_a_run_whose_manifest_is_nested_deeply(archive: Archive) -> None:
    deep = b'{"sha256": ' + b"[" * 100_000 + b"]" * 100_000 + b"}"
    (archive.root / "runs" / archive.runs()[0].id / "grades.json").write_bytes(deep)
    done = CliRunner().invoke(app, ["audit", "--archive", str(archive.root), "--json"])
    assert done.exception is None or isinstance(done.exception, SystemExit | ArchiveUnusable), done.exception
    assert "nested too deeply" in done.output or "nested too deeply" in str(done.exception)


def test_neither_workbench_nor_backup_gives_what_is_behind_a_link_and_both_tell_it(
    archive: Archive, tmp_path: Path
) -> None:
    run, secret = archive.run("latest"), tmp_path / "system"
    secret.mkdir()
    (secret / "passwd").write_text(SECRET, encoding="utf-8")
    report = Path(run.report).read_bytes()
    Path(run.report).unlink()
    Path(run.report).symlink_to(secret / "passwd")
    settings = WorkbenchSettings(archive=str(archive.root), folder=tmp_path / "bench")
    answer = AsgiClient(create_app(settings), settings.address).get(f"/run/report.html?run={run.id}")
    assert answer.status_code == 422
    assert "is a symbolic link to" in answer.json()["problem"]
    assert SECRET not in answer.text
    Path(run.report).unlink()
    Path(run.report).write_bytes(report)
    (archive.root / "runs" / "foreign").symlink_to(secret)
    (archive.root / "runs" / run.id / "notes.txt").symlink_to(secret / "passwd")
    told = r"backup: 2 symbolic links .* were not followed: runs/foreign, runs/.*/notes.txt"
    with pytest.raises(ArchiveUnusable, match=told):
        copy_archive(archive, Archive(tmp_path / "copy"))
    copied = {one.relative_to(tmp_path / "copy").as_posix() for one in (tmp_path / "copy").rglob("*") if one.is_file()}
    assert not any("passwd" in name or "notes" in name for name in copied)
    assert f"runs/{run.id}/grades.parquet" in copied  # all other files


def test_every_reader_of_an_archive_refuses_what_is_behind_a_link(archive: Archive, tmp_path: Path) -> None:
    run = archive.run("latest")
    for place in ("grades.parquet", "grades.json", "run.json", "."):
        path = Path(run.path) / place
        path.rename(tmp_path / "elsewhere")
        path.symlink_to(tmp_path / "elsewhere")
        with pytest.raises(ArchiveUnusable, match=r"symbolic link|there is no run|not a file"):
            run.about if place in {"run.json", "."} else run.table("grades")
        for words in (("audit",), ("verify", run.id)):
            status, out, message = given(*words, "--archive", archive.root)
            assert status != 0
            assert "link" in out + message
        path.unlink()
        (tmp_path / "elsewhere").rename(path)
