"""`list`: result, station and origin of every run, within 80 columns."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from deploy.release import unpack
from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.cli import app

KEPT = Path(__file__).resolve().parents[1] / "archives" / "v1.tar.xz"


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """A kept archive of an older version, with one run more that computes its only run again, and one that has just begun."""
    unpack(KEPT, tmp_path)
    folder = next(path.parent for path in tmp_path.rglob("runs") if path.is_dir())
    store = Archive(folder)
    old = store.run("latest")
    measured = {key: old.about[key] for key in ("recipe", "lot", "station")}
    again = store.open_run("again", {**measured, "rerun_of": old.id}, 1)
    again.adopt(old, ("grades",))
    again.save_report("key", "<html></html>", {})
    store.open_run("begun", {"lot": {"device": "ADXL355", "units": [{"serial": "S1", "slot": 0}]}}, 2)
    return folder


def listed(archive: Path, *words: str) -> str:
    result = CliRunner().invoke(app, ["list", "--archive", str(archive), *words], env={"COLUMNS": "80"})
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_list_shows_result_station_and_what_a_run_is_a_re_run_of(archive: Path) -> None:
    text = listed(archive)
    runs = {info.id: info for info in Archive(archive).runs()}
    again = next(info for info in runs.values() if info.rerun_of)
    assert " ".join(text.split()).startswith(f"3 runs in {archive} ")
    assert f"{again.id} is a re-run of {again.rerun_of}" in text
    assert text.count(f"{again.passed} of {again.graded}") == 2
    assert "unfinished" in text
    assert "simulated" in text


def test_no_word_is_broken_and_the_table_fits_80_columns(archive: Path) -> None:
    text = listed(archive)
    table = [line for line in text.splitlines()[1:] if "is a re-run of" not in line]
    assert max(map(len, table)) <= 80
    for word in (*(info.id for info in Archive(archive).runs()), "simulated", "unfinished", "started (UTC)", "passed"):
        assert word in text


def test_the_document_has_the_same(archive: Path) -> None:
    rows = json.loads(listed(archive, "--json"))["runs"]
    assert [(row["passed"], row["graded"]) for row in rows] == [(2, 2), (2, 2), (None, None)]
    assert [bool(row["rerun_of"]) for row in rows] == [False, True, False]
    assert [row["station"] for row in rows] == ["simulated", "simulated", ""]


def test_one_is_no_plural() -> None:
    assert [number_of(count, "run") for count in (0, 1, 2)] == ["0 runs", "1 run", "2 runs"]
