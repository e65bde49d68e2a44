"""What people do in their first hour: slips, files of another kind, runs stopped half way. One message, and what to do."""

import os
import re
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from capture_double import CaptureDouble, PulledPlug, recipe_file, small_job
from each import each
from in_process import given, refused, text_of
from ledger_events import event
from lots import lot
from pydantic import BaseModel, model_serializer
from root_process import ROOT

from pipelines.archive import Archive, files
from pipelines.certificates import Ledger
from pipelines.chain.runner import Runner
from pipelines.diagnosis.sentences import verdict
from pipelines.jobs.job import Request
from pipelines.jobs.model_files import chosen_effects
from schemas.errors import ArchiveUnusable, RecipeInvalid, WrongUse, did_you_mean

NO_FILE = "x" * 5000
MAPPED = ("--map", "time=t,x=ax,y=ay,z=az", "--unit-of", "output=g", "--units", "A1")
SLIPS: list[tuple[tuple[str, ...], str]] = [  # words of a command, and what is told; {} is a folder with a.csv
    (("diagnos", "x"), "tumbleline: no command is called 'diagnos'; did you mean diagnose?\n"),
    (("run", "nosuch"), "no recipe is called 'nosuch'"),
    (("run", "production", "--units", "SN1,sn1"), "serials SN1 and sn1 differ in capitals alone"),
    (("run", "--units", "{}/lot.csv"), "give the path of a slot map file in CSV or TOML"),
    (("run", "production", "--station", "none.toml"), "none.toml cannot be read"),
    (("show", "nosuch"), "holds no archive, one with runs is needed; name it with --archive or TUMBLELINE_ARCHIVE, or make one"),
    (("show", NO_FILE), ""),
    (("plan", NO_FILE), ""),
    (("plan", "optimize", "nosuch.toml"), "'nosuch.toml'"),
    (("diagnose", NO_FILE + ".csv"), ""),
    (("import", NO_FILE, *MAPPED), ""),
    (("import", "{}/nosuch.csv"), "nosuch.csv: cannot be read (No such file or directory)"),
    (("import", "{}/a.csv"), "no column of a.csv is mapped, x, y and z are needed at least (its columns: t, ax,"),
    (("import", "{}/a.csv", "--map", "x=ax,y=ay,z=az"), "one of g, mg, m/s^2, V, mV, LSB is needed; add --unit-of output=…"),
    (("rerun", "all", "--check", "--effects", "bias"), "--check with another model or limits has no stored result"),
    (("export", "--format", "hex"), "no format is called 'hex'"),
    (("export", "--format", "c", "--json"), "--json prints coefficients, --format c is another form"),
]  # fmt: skip


@each(SLIPS, lambda row: " ".join(row[0])[:60])
def test_a_slip_is_one_message_and_status_2(row: tuple[tuple[str, ...], str], tmp_path: Path) -> None:
    words, told = row
    (tmp_path / "a.csv").write_text("t,ax,ay,az\n0,1,2,3\n", encoding="utf-8")
    archive = () if words[0] in {"plan", "diagnos"} else ("--archive", tmp_path / "archive")
    status, out, message = given(*(word.replace("{}", str(tmp_path)) for word in words), *archive)
    assert (status, out) == (2, "")
    assert told in message
    assert len(message.strip().splitlines()) == 1
    assert len(message) < 400 + len(str(tmp_path))


def test_version_and_help_put_commands_under_what_they_are_for() -> None:
    assert text_of("--version") == f"tumbleline {version('tumbleline')}"
    assert " Commands " not in text_of("--help")


def test_a_model_with_as_many_coefficients_as_dwells_is_not_called_adequate(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    lot(rng, units=2, temperatures=(25.0,)).query("dwell < 4").to_csv(tmp_path / "few.csv", index=False)
    for command in ("diagnose", "compare"):
        message = refused(command, tmp_path / "few.csv", "--effects", "bias,scale,misalignment")
        assert "4 dwells a unit and no degree of freedom to judge the model" in message


def test_close_matches_do_not_care_for_capitals_and_an_empty_list_names_no_effect(tmp_path: Path) -> None:
    assert did_you_mean("adxl356", ["ADXL355", "QA700"]) == "did you mean ADXL355?"
    assert did_you_mean("Third_Ordr", ["third_order", "bias"]) == "did you mean third_order?"
    with pytest.raises(RecipeInvalid, match="no preset 'adxl356'; did you mean ADXL355"):
        Request(recipe=recipe_file(tmp_path, ('device = "adxl355"', 'device = "adxl356"'))).job()
    with pytest.raises(WrongUse, match="--effects ',' names no effect"):
        chosen_effects(",", None, "diagnose")
    assert chosen_effects("", None, "diagnose") is None


def test_a_serial_number_alone_shows_what_holds_today(tmp_path: Path) -> None:
    for serial, end, status, words in (
        ("A1", "2099-01-01", 0, "certificate A1/1 is valid on"),
        ("B1", "2021-01-01", 1, "no calibration is valid on"),
    ):
        Ledger(Archive(tmp_path)).add(event(serial, "2020-01-01", end))
        assert words in text_of("show", serial, "--archive", tmp_path, status=status)


def test_a_run_that_was_stopped_is_refused_with_the_way_on_and_shown_as_such(tmp_path: Path) -> None:
    archive = Archive(tmp_path / "archive")
    with pytest.raises(PulledPlug):
        list(Runner(small_job(tmp_path), archive, measure=CaptureDouble(stop_after=7)).all())
    for command, *option in (("show", "--report"), ("diagnose",), ("export",), ("certificate", "issue")):
        message = refused(command, *option, "latest", "--archive", archive.root)
        assert re.search(
            r"repeat its 'tumbleline run'|give (its|the) .*again|again (to continue|and it goes on)", message
        )
    assert "is not finished (7 records stored)" in text_of("show", "latest", "--archive", archive.root, status=0)


def test_what_lies_outside_the_archive_is_not_told_as_the_archive(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ArchiveUnusable, match=r"^report: .*cannot be written .*; name another place$"):
        files.publish(tmp_path / "file" / "r.html", b"", "report", files.ELSEWHERE)
    with pytest.raises(ArchiveUnusable, match=r"^archive: .*--archive DIR"):
        files.publish(tmp_path / "file" / "r.html", b"")
    assert "cannot be written" in refused("run", "--direct", "--archive", tmp_path / "file")


@pytest.mark.slow
def test_ctrl_c_in_a_capture_says_that_it_goes_on_and_it_does(tmp_path: Path) -> None:
    archive = tmp_path / "archive"
    # a shell that runs the tests in the background has Ctrl-C ignored for all its children
    program = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from pipelines.cli import main; main()"
    command = [sys.executable, "-c", program, "run", "--direct", "--archive", str(archive)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while process.poll() is None and len(list(archive.glob("captures/*/0*"))) < 3:
        time.sleep(0.02)  # another process is waited for
    os.kill(process.pid, signal.SIGINT)
    out, message = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    assert "give the command again to continue the run" in message
    assert "Traceback" not in message
    assert list(archive.rglob(".tmp-*")) == []


def test_ctrl_c_that_a_library_hands_on_as_an_error_of_its_own_is_no_defect(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class Held(BaseModel):
        @model_serializer
        def held(self) -> str:
            raise KeyboardInterrupt

    monkeypatch.setenv("TUMBLELINE_STATE", str(tmp_path))
    monkeypatch.setattr("pipelines.importers.files.read_content", lambda *_: Held().model_dump())
    assert given("import", "a.csv", *MAPPED) == (130, "", "tumbleline: stopped; give the command again\n")
    assert list(tmp_path.iterdir()) == []


# -- what a verdict says -------------------------------------------------------------------------------------------------


def said(error: dict[str, float], group: dict, *units: str) -> str:
    document = {"adequate": False, "blocked_by": [], "unexplained": None, "leave_out": None, "reason": None}
    return verdict({**document, "error": error, "units": [*units], "classes": [group]})


def test_an_error_below_the_noise_is_said_to_be_small_and_a_model_that_fits_beside_faulty_dwells_has_no_misfit() -> (
    None
):
    group = {"effects": ["scale_temperature_quadratic"], "scope": "sensor"}
    for rms, small in ((432.0, True), (441.0, True), (882.0, False)):
        text = said({"rms_ug": rms, "floor_ug": 441.0, "p_value": 4e-190}, group, "U1")
        assert text.startswith("NOT ADEQUATE")
        assert ("the misfit is smaller than the noise" in text) == small
    group = {"effects": ["gain_step"], "scope": "data", "units": ["SN-2"], "dwells": [19]}
    text = said({"rms_ug": 24.6, "floor_ug": 28.9, "p_value": 0.74}, group, "SN-1", "SN-2")
    assert "misfit" not in text
    assert "the run has faults of the data: gain_step (SN-2, dwell 19); without them the model is adequate:" in text


# -- a defect of the product ---------------------------------------------------------------------------------------------


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A product with a defect; the folder of its states."""

    def defect(*_: object) -> None:
        raise KeyError("x")

    monkeypatch.setenv("TUMBLELINE_STATE", str(tmp_path / "state"))
    monkeypatch.setattr("pipelines.importers.files.read_content", defect)
    return tmp_path / "state"


def test_an_unexpected_exception_is_one_line_and_a_report_with_status_70(broken: Path) -> None:
    broken.mkdir()
    for day in range(30):
        (broken / f"unexpected-202501{day:02d}T000000-1.txt").write_text("")
    status, out, message = given("import", "s3://me:secret@host/a.csv", *MAPPED)
    assert (status, out, message.count("\n")) == (70, "", 1)
    reports = sorted(broken.glob("unexpected-*.txt"))
    assert len(reports) == 20  # the oldest are taken away
    assert message.startswith("tumbleline: unexpected KeyError in ")
    assert str(reports[-1]) in message
    text = reports[-1].read_text()
    assert "Traceback (most recent call last)" in text
    assert "secret" not in text
    assert reports[-1].stat().st_mode & 0o077 == 0


def test_a_variable_shows_the_traceback_and_a_folder_that_takes_nothing_still_leaves_a_line(
    monkeypatch: pytest.MonkeyPatch, broken: Path
) -> None:
    broken.write_text("a file where the folder should be")
    status, _, message = given("import", "a.csv", *MAPPED)
    assert (status, message.count("\n")) == (70, 1)
    monkeypatch.setenv("TUMBLELINE_DEBUG", "1")
    status, _, message = given("import", "a.csv", *MAPPED)
    assert (status, "Traceback (most recent call last)" in message) == (70, True)
