"""Certificates and archives from strangers: no XML, JSON or link keeps a command busy, ends it, or leads elsewhere."""

import json
import time
from pathlib import Path

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
from pipelines.workbench.application import create_app
from pipelines.workbench.settings import WorkbenchSettings
from schemas.errors import ArchiveUnusable

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
