"""Work of the workbench: jobs that end, are shared and are told of after a crash; lots whose questions are answered once."""

import json
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib.resources import files
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pandas as pd
import pytest
from capture_double import recipe_file

from benchmarks.generated_archive import write_archive
from pipelines.archive import Archive
from pipelines.audit.sql import ask
from pipelines.jobs.job import Request
from pipelines.jobs.model_files import read_model
from pipelines.workbench.routes.operator import station_named, stations_of
from pipelines.workbench.routes.unit import history_question
from pipelines.workbench.routes.units import newest_question, yield_question
from pipelines.workbench.services import index as shared
from pipelines.workbench.services import jobs as job_table
from pipelines.workbench.services import lots, models, requests, sources, uploads
from pipelines.workbench.services.jobs import Jobs, _serve
from pipelines.workbench.services.work import done_in_process
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import PlanPage, UnitsPage
from schemas.errors import TumblelineError, WrongUse


@pytest.fixture
def settings(tmp_path: Path) -> WorkbenchSettings:
    return WorkbenchSettings(archive=str(tmp_path / "archive"), folder=tmp_path / "bench", token="t")


def left(table: Jobs, name: str, *states: str) -> job_table.BackgroundJob:
    """A job when it is in none of these states any more."""
    end = time.monotonic() + 60.0
    while (job := table.get(name)).state in states:
        assert time.monotonic() < end
        time.sleep(0.01)
    return job


def test_a_stopped_job_ends_its_process_and_the_next_one_runs_is_shared_and_fails_with_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    state, text = done_in_process("diagnose", {}, lambda *_: None)  # a defect does not end the process
    assert (state, "defect" in text) == ("failed", True)
    assert "Traceback" in capsys.readouterr().err
    server, worker = Pipe()
    server.send(("diagnose", {}))
    server.close()
    _serve(worker)  # of a server that was killed: without a word
    assert capsys.readouterr().err == ""
    table = Jobs(tmp_path / "jobs.json", workers=1)
    request = {"recipe": "production", "effects": [], "station": "", "archive": str(tmp_path)}
    job = table.submit("plan", "a plan", request)
    left(table, job.id, "waiting")
    assert table.stop(job.id).state == "stopped"
    bad = {**request, "recipe": str(tmp_path / "none.toml")}
    first, second = table.submit("plan", "another", bad), table.submit("plan", "another", bad)
    assert first is second
    failed = left(table, first.id, "waiting", "running")
    assert failed.state == "failed"
    assert "none.toml" in failed.problem
    assert table.result("plan", bad) is None
    assert table.submit("plan", "another", bad).id == first.id  # a failure can be tried again
    left(table, first.id, "waiting", "running")
    assert table.get(job.id).state == "stopped"
    assert table.result("plan", request) is None
    table.forget("plan", request)  # what it made was removed
    assert table.known("plan", request) is None
    table.close()
    path = tmp_path / "jobs.json"  # what a dead server was at is interrupted and never running
    running = {"id": "a", "kind": "plan", "title": "t", "state": "running"}
    path.write_text(json.dumps({"jobs": [running, {**running, "id": "b", "state": "done"}]}))
    table = Jobs(path, workers=1)
    assert (table.get("a").state, table.get("b")) == ("interrupted", None)
    path.write_text("no json")
    assert Jobs(path, workers=1).all() == []


def lot_of(settings: WorkbenchSettings, **state: object) -> str:
    place = settings.folder / "lots" / "abc"
    place.mkdir(parents=True)
    request = {"recipe": "r", "seats": [[0, "A1"], [3, "A2"]], "units": ["A1", "A2"]}
    (place / "request.json").write_text(json.dumps(request))
    phase = {"phase": "asks", "number": 2, "since": time.time(), "pid": os.getpid()}
    (place / "state.json").write_text(json.dumps(phase | state))
    return "abc"


def test_a_question_is_answered_once_and_by_its_number(settings: WorkbenchSettings) -> None:
    name = lot_of(settings)
    with pytest.raises(lots.Stale):
        lots.answer(settings, name, 1, "go")
    lots.answer(settings, name, 2, "go")
    with pytest.raises(lots.Stale, match="another page"):
        lots.answer(settings, name, 2, "stop")
    assert json.loads((settings.folder / "lots" / name / "answer-2.json").read_text()) == {"answer": "go"}
    with pytest.raises(WrongUse):
        lots.answer(settings, "../abc", 2, "go")


def test_a_lot_whose_process_is_gone_is_interrupted(settings: WorkbenchSettings) -> None:
    gone = os.fork()
    if gone == 0:
        os._exit(0)
    os.waitpid(gone, 0)
    name = lot_of(settings, pid=gone)
    (lot,) = lots.lots(settings)
    assert (lot.id, lot.phase, lot.ended) == (name, "interrupted", True)
    assert lot.slots == ((0, "A1", ""), (3, "A2", ""))


@pytest.mark.parametrize("units", [("A1", "A1"), ("<script>",), ("A" * 65,)])
def test_a_lot_with_a_serial_that_cannot_be_moves_nothing(settings: WorkbenchSettings, units: tuple[str, ...]) -> None:
    with pytest.raises(TumblelineError):
        lots.start(settings, Request("production", None, units, tuple(range(len(units)))))
    assert not (settings.folder / "lots").exists()


@pytest.fixture
def two(settings: WorkbenchSettings, monkeypatch: pytest.MonkeyPatch) -> WorkbenchSettings:
    """Two stations; the processes that would measure are not started."""
    monkeypatch.setattr(lots.subprocess, "Popen", lambda *_, **__: SimpleNamespace(pid=0))
    text = (files("stations") / "simulated.toml").read_text(encoding="utf-8")
    settings.folder.mkdir(parents=True)
    places = [settings.folder / f"{name}.station" for name in ("left", "right")]
    for place in places:
        place.write_text(text.replace('name = "simulated"', f'name = "{place.stem}"'))
    return replace(settings, stations=tuple(places))


def test_each_station_measures_one_lot_at_a_time(two: WorkbenchSettings) -> None:
    left, right = stations_of(two)
    assert (left.name, right.name, left.simulated) == ("left", "right", True)
    recipe = recipe_file(two.folder)
    first = lots.start(two, Request(recipe, left.file, ("A1",), (0,)))
    second = lots.start(two, Request(recipe, right.file, ("B1",), (2,)))
    assert (first.station, second.station) == (left.address, right.address)
    assert first.id != second.id
    with pytest.raises(WrongUse, match=f"has lot {first.id}"):
        lots.start(two, Request(recipe, left.file, ("A2",), (0,)))
    assert lots.start(two, Request(recipe, left.file, ("A1",), (0,))).id == first.id  # the same lot, pressed twice
    assert station_named(stations_of(two), "") == left
    with pytest.raises(WrongUse, match="middle"):
        station_named(stations_of(two), "middle")


def test_a_lot_that_two_pages_start_at_once_has_one_process_which_can_be_stopped(
    two: WorkbenchSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    station, recipe = stations_of(two)[0], recipe_file(two.folder)
    begun: list[int] = []

    def slowly(*_: object, **__: object) -> SimpleNamespace:
        time.sleep(0.2)
        begun.append(os.getpid())
        return SimpleNamespace(pid=begun[-1])

    monkeypatch.setattr(lots.subprocess, "Popen", slowly)
    with ThreadPoolExecutor(3) as pages:
        states = list(pages.map(lambda _: lots.start(two, Request(recipe, station.file, ("A1",), (0,))), range(3)))
    assert len(begun) == 1
    assert {state.pid for state in states} == set(begun)


def test_a_paused_lot_keeps_its_station_and_a_stopped_one_makes_room(two: WorkbenchSettings) -> None:
    left = stations_of(two)[0]
    recipe = recipe_file(two.folder)
    lot = lots.start(two, Request(recipe, left.file, ("A1",), (0,)))
    lots.pause(two, lot.id)
    place = two.folder / "lots" / lot.id
    lots.write_state(place, {"phase": "stopped", "since": time.time()})  # what its process writes after the safe state
    paused = lots.state_of(place)
    assert (paused.phase, paused.ended, paused.idle) == ("paused", False, True)
    with pytest.raises(WrongUse, match="paused"):
        lots.start(two, Request(recipe, left.file, ("A2",), (0,)))
    assert lots.again(two, lot.id).phase == "starting"
    lots.pause(two, lot.id)
    lots.write_state(place, {"phase": "stopped", "since": time.time()})
    assert lots.stop(two, lot.id).phase == "stopped"
    assert lots.start(two, Request(recipe, left.file, ("A2",), (0,))).phase == "starting"
    with pytest.raises(lots.Stale):
        lots.pause(two, lot.id)


def test_lots_are_paused_and_waited_for_when_the_service_ends(settings: WorkbenchSettings) -> None:
    script = """
import json, pathlib, signal, sys, time
place = pathlib.Path(sys.argv[1]) / "state.json"
def safe(*_):
    place.write_text(json.dumps({**json.loads(place.read_text()), "phase": "stopped"}))
    sys.exit(0)
signal.signal(signal.SIGTERM, safe)
print("ready", flush=True)
time.sleep(60)
"""
    place = settings.folder / "lots" / "abc"
    with subprocess.Popen([sys.executable, "-c", script, str(place)], stdout=subprocess.PIPE) as process:
        lot_of(settings, pid=process.pid, phase="measuring")
        assert process.stdout.readline() == b"ready\n"
        assert lots.pause_all(settings) == []
        assert process.wait(10.0) == 0
    assert lots.state_of(place).phase == "paused"


def test_a_model_is_saved_version_by_version_with_its_formulas(settings: WorkbenchSettings) -> None:
    start, formulas = ["bias", "scale"], ["humid = humidity_pct - 45"]
    place, version = models.save(settings, "line-1", start, ["third_order", "humid"], formulas, "seen twice", "run-7")
    assert version == 3
    model = read_model(place)
    assert model.model.effects == ["bias", "scale", "third_order", "humid"]
    assert [change.why for change in model.change][1:] == ["seen twice", "seen twice"]
    added = ["third_order", "humid", "second_order"]
    assert models.save(settings, "line-1", start, added, formulas, "more", "run-8")[1] == 4
    with pytest.raises(WrongUse, match="already"):
        models.save(settings, "line-1", start, ["third_order"], [], "again", "run-8")
    with pytest.raises(WrongUse, match="other effects"):
        models.save(settings, "line-1", [*start, "misalignment"], ["cross_coupling"], [], "of another model", "run-8")
    recipe, sample = settings.folder / "six.toml", Path(__file__).parents[4] / "deploy/recipes/line-six.toml"
    recipe.write_text(re.sub(r"effects = .*", f'model = "{place}"', sample.read_text()))
    before = requests.plan(settings, PlanPage(recipe=str(recipe)))[1]
    assert models.save(settings, "line-1", start, [*added, "cross_coupling"], formulas, "more", "run-8")[1] == 5
    assert requests.plan(settings, PlanPage(recipe=str(recipe)))[1] != before  # the recipe's file is as it was
    for name, why in (("../x", "a reason"), ("ok", "  "), ("", "a reason")):
        with pytest.raises(WrongUse):
            models.save(settings, name, start, ["third_order"], [], why, "")


def test_files_of_the_folder_alone_are_sources_and_an_upload_stays_in_it_whatever_it_is_called(
    settings: WorkbenchSettings, tmp_path: Path
) -> None:
    settings.folder.mkdir()
    frame = pd.DataFrame({"unit": ["U"], "dwell": [0]})
    for name in ("dwells.csv", "fresh.csv", "dwells-history.csv"):
        frame.to_csv(settings.folder / name)
    frame.to_csv(tmp_path / "other.csv")
    (settings.folder / "link.csv").symlink_to(tmp_path / "other.csv")
    assert [one.label for one in sources.sources(settings)] == ["dwells.csv", "fresh.csv"]
    assert sources.twin(settings, str(settings.folder / "dwells.csv")) == str(settings.folder / "fresh.csv")
    for name in (str(tmp_path / "other.csv"), str(settings.folder / "link.csv"), f"{settings.folder}/../other.csv"):
        with pytest.raises(WrongUse):
            sources.resolve(settings, name, "source")

    def keep(name: str, content: bytes) -> str:
        part = uploads.part_of(settings)
        part.write_bytes(content)
        return uploads.keep(settings, name, part)

    first = keep("../../etc/a<b>.csv", b"1")
    assert Path(first).parent == settings.folder / "uploads"
    assert keep("../../etc/a<b>.csv", b"1") == first
    assert keep("a<b>.csv", b"2") != first
    for name in ("a.exe", "", ".."):
        with pytest.raises(WrongUse):
            keep(name, b"1")
    with pytest.raises(WrongUse):
        uploads.resolve(settings, "/etc/passwd")
    told = "give --unit-of output=g, or --unit-of time=…; --rate HZ, --set gaps=split"
    assert uploads.in_fields(told) == (
        "give the field 'Unit of the output' (g), or the field 'Unit of time'; the field 'Rate', --set gaps=split; what begins "
        "with -- is an option of the command line"
    )
    told = "audit: --since 2026-02-01 is after --until 2026-01-01, a period is needed"
    assert "the field 'From' 2026-02-01 is after the field 'Until' 2026" in uploads.in_fields(told, "audit")
    told = "release: no reason is given, one is needed; give --reason TEXT"
    assert uploads.in_fields(told, "release").endswith("one is needed; give the field 'Reason'")


def test_a_run_that_was_added_is_in_the_next_answer_and_an_unchanged_archive_is_not_looked_at_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked = Mock(side_effect=shared.up_to_date)
    monkeypatch.setattr(shared, "up_to_date", looked)
    archive = Archive(str(tmp_path / "archive"))
    recent = shared.RecentIndex(str(tmp_path / "archive"))
    question = "SELECT run FROM runs ORDER BY run"
    assert recent.ask(question).rows == []
    names = []
    for number in range(3):
        names.append(archive.open_run(f"lot{number}", {"recipe": {"name": "r"}, "lot": {"units": []}}, number).id)
        assert [name for (name,) in recent.ask(question).rows] == names
    before = looked.call_count
    for _ in range(5):
        recent.ask(question)
    assert looked.call_count == before
    monkeypatch.setattr(shared, "USABLE_S", 0.0)  # old
    recent.ask(question)
    assert looked.call_count == before + 1


def test_a_search_in_memory_gives_what_the_files_of_the_archive_give(tmp_path: Path) -> None:
    archive = tmp_path / "archive"
    write_archive(archive, 6, years=2.0, seed=3, workers=1)
    recent = shared.RecentIndex(str(archive))
    pages = [
        UnitsPage(), UnitsPage(search="3", order="unit"), UnitsPage(outcome="fail", order="station", page=2),
        UnitsPage(station="line-1", since="2022-01-01", order="outcome"),
        UnitsPage(search="no'such"), UnitsPage(search="RUN"), UnitsPage(search="100%_µ!"),
    ]  # fmt: skip
    questions = [question(page) for page in pages for question in (UnitsPage.question, yield_question)]
    unit = str(recent.ask(UnitsPage().question()).rows[0][0])
    for question in (*questions, newest_question(12), history_question(unit)):
        answer = recent.of_unit(unit, question) if "coefficients" in question else recent.ask(question)
        wanted = ask(Archive(str(archive)), question)
        assert answer.columns == wanted.columns
        assert answer.rows == wanted.rows if "ORDER BY" in question else sorted(answer.rows) == sorted(wanted.rows)
    with pytest.raises(WrongUse):
        recent.ask("DELETE FROM units")
    assert recent.ask("SELECT count(*) FROM units").rows[0][0] > 0
    assert recent.of_unit(unit, history_question(unit)).rows
