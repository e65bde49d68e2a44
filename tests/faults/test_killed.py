"""A process killed with SIGKILL anywhere: the same command goes on, measures nothing twice, and ends with the same bytes."""

import os
import signal
from io import BytesIO
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from capture_double import AT_ROOM, recipe_file

from pipelines.archive import Archive, files
from pipelines.archive.cleaning import clean
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.jobs.job import Request
from stations.plant.plant import PlantClock

PATIENCE_S = 120.0
RESULTS = (
    "readings", "history", "verdicts", "dwells", "coefficients", "covariance", "residuals", "verification", "noise", "allan",
    "figures", "grades",
)  # fmt: skip
TIMES, CHAINS = 50, 5


def die() -> None:
    """Ends the process as a power cut would."""
    os.kill(os.getpid(), signal.SIGKILL)


def dying(folder: Path, how: str) -> None:
    """A run that kills itself where it is told: plant:SECONDS | stage:NAME | file:NUMBER."""
    kind, _, value = how.partition(":")
    sleep, write, written = PlantClock.sleep, files._write_durably, list[Path]()

    def until(clock: PlantClock, span: float) -> None:
        left = float(value) - clock.now()
        sleep(clock, min(left, span))
        if left <= span:
            die()

    def aside(path: Path, data: bytes) -> None:
        """So many files are written aside, and the last is not yet in its place."""
        write(path, data)
        written.append(path)
        if len(written) == int(value):
            die()

    if kind == "plant":
        PlantClock.sleep = until
    if kind == "file":
        files._write_durably = aside
    for done in Runner(Request(recipe=str(folder / "small.toml")).job(), Archive(folder / "archive")).all():
        if how == f"stage:{done.stage}":
            die()


def run(folder: Path, how: str = "") -> int | None:
    """Status of a run that may kill itself."""
    process = get_context("spawn").Process(target=dying, args=(folder, how), daemon=True)
    process.start()
    process.join(PATIENCE_S)
    return process.exitcode


def records(folder: Path) -> dict[str, tuple[int, int]]:
    """What tells a stored record from one that was measured again: its file and when it was written."""
    stats = {path: path.stat() for path in (folder / "archive").glob("captures/*/[0-9]*/samples.parquet")}
    return {path.parent.name: (stat.st_ino, stat.st_mtime_ns) for path, stat in stats.items()}


def killed(folder: Path, how: str) -> None:
    """A run killed as it is told; what was finished before is as it was."""
    before = records(folder)
    assert run(folder, how) == -signal.SIGKILL, how
    after = records(folder)
    assert {name: after[name] for name in before} == before, "a finished dwell was measured again"


def finish(folder: Path) -> dict[str, bytes]:
    """The bytes of every result, with nothing left lying about."""
    before = records(folder)
    assert run(folder) == 0
    assert {name: records(folder)[name] for name in before} == before
    assert not list(folder.glob("archive/**/.tmp-*"))
    [run_folder] = (folder / "archive" / "runs").iterdir()
    return {name: (run_folder / f"{name}.parquet").read_bytes() for name in RESULTS}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("undisturbed")
    recipe_file(folder)
    return finish(folder)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("chain", range(CHAINS))
def test_a_run_killed_at_random_times_ends_in_the_same_bytes(
    tmp_path: Path, undisturbed: dict[str, bytes], chain: int
) -> None:
    recipe_file(tmp_path)
    length = station_seconds(undisturbed)
    times = np.sort(np.random.default_rng([2026, chain]).uniform(1.0, length, TIMES // CHAINS))
    for time in times:
        killed(tmp_path, f"plant:{time:.6f}")
    assert finish(tmp_path) == undisturbed


def station_seconds(results: dict[str, bytes]) -> float:
    """How long the undisturbed capture took, in the station's time."""
    last = pd.read_parquet(BytesIO(results["readings"])).iloc[-1]
    return float(last["start_s"] + last["duration_s"])


PLACES = {
    "every stage boundary": [f"stage:{stage}" for stage in ORDER],
    "a file that is not yet in its place": [f"file:{number}" for number in (1, 2, 3, 7, 30, 12, 9, 20, 41, 5, 17, 26)],
}


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("place", PLACES)
def test_a_run_killed_there_ends_in_the_same_bytes(tmp_path: Path, undisturbed: dict[str, bytes], place: str) -> None:
    recipe_file(tmp_path)
    for how in PLACES[place]:
        killed(tmp_path, how)
    assert finish(tmp_path) == undisturbed


@pytest.mark.slow
def test_what_a_killed_writer_leaves_is_taken_away_by_clean(tmp_path: Path) -> None:
    recipe_file(tmp_path)
    killed(tmp_path, "file:7")
    archive = Archive(tmp_path / "archive")
    left = sorted(str(path) for path in archive.root.rglob(f"{files.TEMPORARY}*"))
    assert left
    assert sorted(clean(archive, only_look=True).removed) == left
    assert sorted(clean(archive).removed) == left
    assert not list(archive.root.rglob(f"{files.TEMPORARY}*"))


ENDS_EARLY = (
    *AT_ROOM[:2],
    ('limits = "consumer"', 'limits = "offsets.toml"'),
    ('poses = "nine"', 'poses = "orthogonal24"'),
    ("static_record_s = 30.0", 'static_record_s = 30.0\nverification_order = "interleaved"'),
    (
        '["bias", "scale", "misalignment"]',
        '["bias", "scale", "misalignment"]\nstop = { bias_ug = 800.0, longest_dwell_s = 2.0 }',
    ),
)
OFFSETS = 'name = "offsets"\ngrade = "none"\n[figures]\nzero_g_offset_mg = { max = 75.0, unit = "mg" }\n'


def decided(folder: Path) -> list[tuple[str, int, str]]:
    """What the journal says of the looks at a lot."""
    [capture] = (folder / "archive" / "captures").iterdir()
    events = Archive(folder / "archive").capture(capture.name).events.recorded()
    kinds = ("look", "known", "given_up", "fails")
    return [(event.kind, event.record, event.reason) for event in events if event.kind in kinds]


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_lot_that_ends_early_is_killed_and_decides_the_same(tmp_path: Path) -> None:
    """Killed within dwells, at looks and at files that are not yet in their place: the same looks, the same bytes."""
    whole, again = tmp_path / "whole", tmp_path / "again"
    for folder in (whole, again):
        folder.mkdir()
        recipe_file(folder, *ENDS_EARLY)
        (folder / "offsets.toml").write_text(OFFSETS, encoding="utf-8")
    results = finish(whole)
    looks = decided(whole)
    assert [kind for kind, _, _ in looks if kind == "known"] == ["known"]
    assert len(pd.read_parquet(BytesIO(results["readings"]))["record"].unique()) < 24
    length = station_seconds(results)
    for time in np.sort(np.random.default_rng(34).uniform(1.0, length, 8)):
        killed(again, f"plant:{time:.6f}")
    for number in (1, 3, 8):
        killed(again, f"file:{number}")
    assert finish(again) == results
    assert decided(again) == looks
