"""The list of an archive with many runs: read once, true whenever a run changes."""

import json
import os
import time
from pathlib import Path

import pytest

from pipelines.archive import Archive, Run, derived, files, listing
from pipelines.archive.keys import digest

LOTS = 40


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    """An archive of runs that were begun long ago, one of them finished."""
    store = Archive(tmp_path / "archive")
    for n in range(LOTS):
        lot = {"device": "ADXL355", "units": [{"serial": f"S{n}", "slot": 0}]}
        run = store.open_run("line", {"station": {"name": "st-1"}, "recipe": {"name": "line"}, "lot": lot}, n)
    (run.path / "report.html").write_text("")
    for path in (tmp_path / "archive" / "runs").iterdir():
        os.utime(path, (time.time() - 100.0, time.time() - 100.0))
    return store


def test_the_list_is_read_again_without_the_runs_but_those_that_are_new_were_written_to_or_are_gone(
    archive: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = archive.runs()
    assert len(first) == LOTS
    with monkeypatch.context() as patch:
        patch.setattr(listing, "info_of", lambda run: pytest.fail(f"{run.id} was read again"))
        assert archive.runs() == first
    run = archive.open_run("line", {"lot": {"units": []}}, "new")
    archive.runs()
    noted_ids = json.loads((archive.root / "index" / "list.json").read_text())["runs"]
    assert len(noted_ids) == LOTS
    assert run.id not in noted_ids
    archive.runs()
    begun = next(info for info in archive.runs() if not info.finished)
    (Run(archive, begun.id).path / "report.html").write_text("")
    assert next(info for info in archive.runs() if info.id == begun.id).finished
    (archive.root / "runs" / first[1].id / "run.json").unlink()
    (archive.root / "runs" / first[1].id).rmdir()
    assert len(archive.runs()) == LOTS
    (archive.root / "index" / "list.json").write_text("{half")  # a spoilt note does no harm
    assert len(archive.runs()) == LOTS


def test_a_line_of_an_older_version_is_read_again_and_is_no_edit(archive: Archive) -> None:
    archive.runs()
    place = archive.root / "index" / "list.json"
    content = json.loads(place.read_text())
    older = {name: [stamp, line[:7]] for name, (stamp, line) in content["runs"].items()}
    files.publish(place, files.json_bytes({"runs": older, "seal": derived.seal({"runs": digest(older)})}))
    name, (_, line) = next(iter(older.items()))
    info = listing.info_of(Run(archive, name))
    assert listing.agrees(info, line)
    assert not listing.agrees(info, [*line[:2], "another device", *line[3:]])
    assert all(info.station == "st-1" for info in archive.runs())  # not in the older lines
