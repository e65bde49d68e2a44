"""What people do in their first hour: slips, files of another kind, runs stopped half way. One message, and what to do."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from capture_double import CaptureDouble, PulledPlug, recipe_file, small_job
from lots import lot

from pipelines.archive import Archive, files
from pipelines.chain.runner import Runner
from pipelines.cli import main
from pipelines.importers import exchange
from pipelines.jobs.job import Request
from pipelines.jobs.model_files import chosen_effects
from schemas.errors import ArchiveUnusable, DataRejected, RecipeInvalid, WrongUse, did_you_mean

ROOT = Path(__file__).resolve().parents[2]


def told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Status, output and message of a command."""
    monkeypatch.setattr("sys.argv", ["tumbleline", *arguments])
    with pytest.raises(SystemExit) as left:
        main()
    captured = capsys.readouterr()
    return int(left.value.code or 0), captured.out, captured.err


@pytest.fixture
def stopped(tmp_path: Path) -> Archive:
    """An archive with one run whose capture was cut off after seven records."""
    archive = Archive(tmp_path / "archive")
    with pytest.raises(PulledPlug):
        list(Runner(small_job(tmp_path), archive, measure=CaptureDouble(stop_after=7)).all())
    return archive


def dwells(n: int = 4) -> pd.DataFrame:
    frame = pd.DataFrame({"unit": "A1", "dwell": range(n), "time_s": np.arange(n) * 10.0})
    return frame.assign(out_x=0.1, out_y=0.2, out_z=0.97)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.assign(n=[100, 100, 0, 100]), r"row 2, column n: found 0, a mean of 1 or more samples"),
        (lambda t: t.assign(out_unit="parsec"), r"column out_unit: found 'parsec', one of V, LSB, g, m/s\^2 is needed"),
        (lambda t: t.assign(time_s=5.0), r"column time_s: all 4 dwells of unit A1 at 5 s"),
    ],
)
def test_dwells_that_cannot_be_are_refused(change, words: str) -> None:
    with pytest.raises(DataRejected, match=words):
        exchange.checked(change(dwells()), where="f.csv")


def test_one_dwell_of_a_unit_needs_no_second_time() -> None:
    assert len(exchange.checked(dwells(1), where="f.csv")) == 1


@pytest.mark.parametrize("command", ["diagnose", "compare"])
def test_a_model_with_as_many_coefficients_as_dwells_is_not_called_adequate(
    tmp_path: Path,
    rng: np.random.Generator,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: str,
) -> None:
    table = lot(rng, units=2, temperatures=(25.0,)).query("dwell < 4")
    table.to_csv(tmp_path / "few.csv", index=False)
    model = ("--effects", "bias,scale,misalignment")
    status, out, message = told(monkeypatch, capsys, command, str(tmp_path / "few.csv"), *model)
    assert (status, out) == (2, "")
    assert "4 dwells a unit leave no degree of freedom to judge the model" in message


def test_a_kind_of_device_with_a_slip_is_refused_before_anything_moves(tmp_path: Path) -> None:
    recipe = recipe_file(tmp_path, ('device = "adxl355"', 'device = "adxl356"'))
    with pytest.raises(RecipeInvalid, match="no preset 'adxl356'; did you mean ADXL355"):
        Request(recipe=recipe).job()


def test_close_matches_do_not_care_for_capitals() -> None:
    assert did_you_mean("adxl356", ["ADXL355", "QA700"]) == "did you mean ADXL355?"
    assert did_you_mean("Third_Ordr", ["third_order", "bias"]) == "did you mean third_order?"


def test_a_command_with_a_slip_is_told_with_close_matches(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, message = told(monkeypatch, capsys, "diagnos", "x")
    assert (status, out) == (2, "")
    assert message == "tumbleline: no command is called 'diagnos'; did you mean diagnose?\n"


def test_a_list_of_effects_with_nothing_in_it_is_refused() -> None:
    with pytest.raises(WrongUse, match="--effects ',' names no effect"):
        chosen_effects(",", None, "diagnose")
    assert chosen_effects("", None, "diagnose") is None


@pytest.mark.parametrize("command", ["report", "diagnose", "export"])
def test_a_run_that_was_stopped_is_refused_with_the_way_on(
    stopped: Archive, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    status, out, message = told(monkeypatch, capsys, command, "latest", "--archive", str(stopped.root))
    assert (status, out) == (2, "")
    assert re.search(r"repeat its 'tumbleline run'|give (its|the) .*again|again (to continue|and it goes on)", message)


def test_a_run_that_was_stopped_is_shown_as_such(
    stopped: Archive, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, _ = told(monkeypatch, capsys, "show", "latest", "--archive", str(stopped.root))
    assert status == 0
    assert "is not finished (7 records stored)" in out


def test_what_lies_outside_the_archive_is_not_told_as_the_archive(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ArchiveUnusable, match=r"^report: .*cannot be written .*; name another place$"):
        files.publish(tmp_path / "file" / "r.html", b"", "report", files.ELSEWHERE)
    with pytest.raises(ArchiveUnusable, match=r"^archive: .*--archive DIR"):
        files.publish(tmp_path / "file" / "r.html", b"")


@pytest.mark.slow
def test_ctrl_c_in_a_capture_says_that_it_goes_on_and_it_does(tmp_path: Path) -> None:
    archive = tmp_path / "archive"
    # a shell that runs the tests in the background has Ctrl-C ignored for all its children
    program = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from pipelines.cli import main; main()"
    command = [sys.executable, "-c", program, "run", "--direct", "--archive", str(archive)]
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while process.poll() is None and len(list(archive.glob("captures/*/0*"))) < 3:
        time.sleep(0.02)  # another process is waited for
    os.kill(process.pid, signal.SIGINT)
    out, message = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    assert "give the command again to continue the run" in message
    assert "Traceback" not in message
    assert list(archive.rglob(".tmp-*")) == []
