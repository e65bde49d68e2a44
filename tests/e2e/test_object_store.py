"""An archive in an object store: a real S3 server process on loopback, started here."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from capture_double import CaptureDouble, PulledPlug, small_job, small_run
from each import each
from in_process import document_of
from ledger_events import event
from s3_server import CREDENTIALS, s3_bucket

from pipelines.archive import Archive, Run
from pipelines.archive.locks import alone
from pipelines.archive.store import ObjectPath
from pipelines.certificates import Ledger
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from schemas.errors import ArchiveUnusable, OperatorNeeded

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def query() -> Iterator[str]:
    with pytest.MonkeyPatch.context() as patch, s3_bucket() as bucket_query:
        for name, value in CREDENTIALS.items():
            patch.setenv(name, value)
        yield bucket_query


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return small_run(tmp_path_factory.mktemp("local"))


@pytest.fixture(scope="module")
def address(query: str, tmp_path_factory: pytest.TempPathFactory) -> str:
    """An archive with a run that was cut off once and went on."""
    address = f"s3://factory/main?{query}"
    job = small_job(tmp_path_factory.mktemp("job"))
    with pytest.raises(PulledPlug):
        list(Runner(job, Archive(address), measure=CaptureDouble(stop_after=5)).all())
    double = CaptureDouble()
    list(Runner(job, Archive(address), measure=double).all())
    assert len(double.measured) == job.recipe.planned_records - 5
    return address


def ask(address: str, *words: object) -> dict:
    return document_of(*words, "--archive", address)


def test_a_run_there_has_the_same_bytes_as_one_in_a_folder_and_nothing_is_done_twice(
    address: str, local: Run, tmp_path: Path
) -> None:
    run = Archive(address).run(local.id)
    assert set(run.tables()) == set(local.tables())
    for name in local.tables():
        assert (run.path / f"{name}.parquet").read_bytes() == (local.path / f"{name}.parquet").read_bytes()
    runner = Runner(small_job(tmp_path), Archive(address), measure=CaptureDouble(stop_after=0))
    assert [done.reused for done in runner.all()] == [True] * len(ORDER)


def test_the_commands_work_on_an_address(address: str, local: Run) -> None:
    assert ask(address, "list")["runs"][0]["id"] == local.id
    shown = ask(address, "show", local.id)
    assert {unit["outcome"] for unit in shown["units"]} == {"pass"}
    assert shown["report"].startswith("s3://factory/main/runs/small-")
    ask(address, "certificate", "issue", local.id)
    assert ask(address, "show", "A2")["calibration"]["certificate"] == "A2/1"
    ask(address, "certificate", "revoke", "A2", "--reason", "lost")
    assert [e.action for e in Ledger(Archive(address)).events("A2")] == ["certify", "revoke"]
    assert {one.serial for one in Ledger(Archive(address)).all()} == {"A1", "A2", "A3"}
    before, linear = len(Archive(address).runs()), "bias,scale,bias_temperature,misalignment,scale_temperature"
    assert ask(address, "fit", local.id, "--effects", linear)["run"] != local.id
    ask(address, "rerun", local.id, "--effects", f"{linear},third_order")
    assert len(Archive(address).runs()) == before + 2
    report = ask(address, "verify")
    assert (report["whole"], report["findings"], report["runs"]) == (True, [], before + 2)
    assert {step["name"] for step in ask(address, "lineage", local.id)["steps"]} >= {"capture", "fit", "grade"}


def test_a_changed_object_and_a_missing_one_are_found(query: str, tmp_path: Path) -> None:
    store = Archive(f"s3://factory/spoilt?{query}")
    list(Runner(small_job(tmp_path), store, measure=CaptureDouble()).all())
    path = store.run("latest").path
    (path / "noise.parquet").write_bytes((path / "noise.parquet").read_bytes()[:-5] + b"spoil")
    (path / "wander.parquet").unlink()
    findings = {(f["kind"], f["path"].rpartition("/")[2]) for f in ask(store.address, "verify")["findings"]}
    assert findings == {("changed", "noise.parquet"), ("missing", "wander.parquet")}


def test_clean_takes_away_claims_of_dead_processes_there(query: str, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Archive(f"s3://factory/dead?{query}")
    store.prepare()
    (store.root / "captures" / "c" / "claim-dead").write_bytes(b"")
    (store.root / "captures" / "d" / "claim-alive").write_bytes(b"")
    monkeypatch.setattr("pipelines.archive.cleaning.LEASE_S", -1.0)  # as if they had not been renewed for long
    assert len(ask(store.address, "archive", "clean")["removed"]) == 2
    assert ask(store.address, "archive", "clean")["removed"] == []


def test_eight_writers_of_one_unit_lose_nothing(query: str) -> None:
    ledger = Ledger(f"s3://factory/ledger?{query}")

    def write(n: int) -> None:
        ledger.add(event(start=f"2026-01-{n:02d}", until="2099-01-01", run=f"r-{n}"), supersede=True)

    threads = [threading.Thread(target=write, args=(n,)) for n in range(1, 9)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    events = ledger.events("A1")
    assert [e.sequence for e in events] == list(range(1, 9))
    assert {e.run for e in events} == {f"r-{n}" for n in range(1, 9)}


def test_a_second_capture_and_a_folder_that_is_no_archive_are_refused_and_a_dead_capture_does_not_block(
    query: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = Archive(f"s3://factory/locks?{query}").root / "captures" / "c"
    with alone(place), pytest.raises(OperatorNeeded, match="another process is measuring"), alone(place):
        pass
    archive = Archive(f"s3://factory/foreign?{query}")
    (archive.root / "holiday.jpg").write_bytes(b"x")
    with pytest.raises(ArchiveUnusable, match=r"s3://factory/foreign holds other files and no archive"):
        archive.prepare()
    (place / "claim-dead").write_bytes(b"")
    with pytest.raises(OperatorNeeded), alone(place):
        pass
    monkeypatch.setattr("pipelines.archive.locks.LEASE_S", -1.0)  # as if it had not been renewed for long
    with alone(place):
        pass
    assert not list(place.iterdir())


@each(["nosuch/archive?{query}", "factory/a?endpoint_override=127.0.0.1:9&scheme=http&region=us-east-1"])
def test_a_store_that_cannot_be_reached_is_one_message(place: str, query: str) -> None:
    with pytest.raises(ArchiveUnusable, match=r"^archive: s3://[^\n]*$"):
        Archive(f"s3://{place.format(query=query)}").prepare()


def test_an_address_that_is_none_is_one_message_and_places_have_the_names_of_paths() -> None:
    with pytest.raises(ArchiveUnusable, match="address 'nosuch://bucket/x' cannot be used") as problem:
        Archive("nosuch://someone:secret@bucket/x")
    place = ObjectPath(None, "bucket/a/b.json", "s3", "s3://k:secret@bucket/a")
    assert "secret" not in f"{problem.value} {place!r}"
