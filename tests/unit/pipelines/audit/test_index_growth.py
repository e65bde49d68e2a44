"""The index of the audit grows with the runs: what is added is what an audit would make, and small parts become one."""

import json
import logging
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from capture_double import small_run

from pipelines.archive import Archive
from pipelines.audit import index_growth
from pipelines.audit.calibrations import load
from pipelines.audit.index import FOLDER, AuditIndex, part_folders, runs_of, up_to_date, version_of_rows
from pipelines.audit.index_growth import add_runs
from pipelines.audit.population import Figures, figures_of


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    """Six finished runs, one and its copies under other names: the index reads their files only."""
    name = small_run(tmp_path).id
    runs = tmp_path / "archive" / "runs"
    for number in range(5):
        shutil.copytree(runs / name, runs / f"copy-{number}")
    return Archive(tmp_path / "archive")


def index_of(archive: Archive) -> Path:
    return Path(str(archive.root)) / FOLDER


def names(archive: Archive) -> list[str]:
    return sorted(place.name for place in (archive.root / "runs").iterdir())


def rows(archive: Archive, table: str) -> list[dict]:
    """The rows of a table of the index, in an order that does not depend on its parts."""
    return sorted(up_to_date(archive).table(table).to_pylist(), key=lambda row: json.dumps(row, default=str))


def test_an_audit_finds_every_run_that_was_added_and_reads_none_again(archive: Archive) -> None:
    assert add_runs(archive, []) == 0
    assert not index_of(archive).exists()
    first, *others = names(archive)
    assert add_runs(archive, [first]) == 1
    assert add_runs(archive, others) == len(others)
    index = up_to_date(archive)
    assert (index.made, index.kept) == (0, 6)
    added = {name: rows(archive, name) for name in ("runs", "coefficients")}
    shutil.rmtree(index_of(archive))
    assert up_to_date(archive).made == 6
    assert added == {name: rows(archive, name) for name in ("runs", "coefficients")}
    assert {row["run"] for row in added["runs"]} == set(names(archive))


def test_small_parts_become_one_when_there_are_many(archive: Archive, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(index_growth, "MOST_SMALL", 3)
    sizes: list[int] = []
    parts: list[int] = []
    for name in names(archive):
        sizes.append(add_runs(archive, [name]))
        parts.append(len(part_folders(index_of(archive))))
    assert sizes == [1, 1, 1, 4, 1, 1]
    assert parts == [1, 2, 3, 1, 2, 3]
    held = [runs_of(part, version_of_rows()) for part in part_folders(index_of(archive))]
    assert sorted(run for part in held for run in part) == names(archive), "every run once"


def test_figures_do_not_depend_on_the_order_of_parts(archive: Archive) -> None:
    for name in names(archive):
        add_runs(archive, [name])
    index = up_to_date(archive)
    backwards = replace(index, parts=index.parts[::-1])
    assert len(index.parts) == 6

    def figures(of: AuditIndex) -> Figures:
        runs = of.table("runs", ["run", "device", "station"]).to_pandas().astype(str)
        # an audit counts copies of a capture once; here each is a calibration of its own, a day after the one before
        calibrations = load(of, runs.assign(day=[20_000.0 + names(archive).index(run) for run in runs["run"]]))
        return figures_of(of, calibrations, np.ones(calibrations.day.size, dtype=bool))

    here, there = figures(index), figures(backwards)
    assert here.row.size > 0
    for column in ("row", "figure", "value", "limit", "unit_text"):
        np.testing.assert_array_equal(getattr(here, column), getattr(there, column), err_msg=column)


def test_an_index_that_cannot_grow_is_a_warning(archive: Archive, caplog: pytest.LogCaptureFixture) -> None:
    index_of(archive).write_text("in the way", encoding="utf-8")
    with caplog.at_level(logging.WARNING, "tumbleline.archive"):
        assert add_runs(archive, names(archive)) == 0
    assert "the next audit does it" in caplog.text
