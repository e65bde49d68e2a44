"""A process killed with SIGKILL, at points all over a run: the same command goes on and ends with the same bytes."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from capture_double import recipe_file

PATIENCE_S = 120.0
RESULTS = ("readings", "history", "verdicts", "dwells", "coefficients", "covariance", "residuals", "verification")
MORE_RESULTS = ("allan", "noise", "figures", "grades")


def start(folder: Path) -> subprocess.Popen[bytes]:
    command = [
        sys.executable,
        "-m",
        "pipelines.cli",
        "run",
        recipe_file(folder),
        "--direct",
        "--archive",
        str(folder / "archive"),
    ]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def kill_when(process: subprocess.Popen[bytes], folder: Path, pattern: str, count: int) -> None:
    """Kill the process as soon as so many files of a pattern are there."""
    end = time.monotonic() + PATIENCE_S
    while len(list(folder.glob(pattern))) < count:
        assert process.poll() is None, "the run was over before it could be killed"
        assert time.monotonic() < end
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL


def finish(folder: Path) -> dict[str, bytes]:
    assert start(folder).wait(PATIENCE_S) in (0, 1)
    [run] = (folder / "archive" / "runs").iterdir()
    return {name: (run / f"{name}.parquet").read_bytes() for name in (*RESULTS, *MORE_RESULTS)}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return finish(tmp_path_factory.mktemp("undisturbed"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pattern", "count"),
    [
        ("archive/archive.json", 1),
        ("archive/captures/*/[0-9]*/record.json", 1),
        ("archive/captures/*/[0-9]*/record.json", 12),
        ("archive/captures/*/complete.json", 1),
        ("archive/runs/*/coefficients.parquet", 1),
        ("archive/runs/*/figures.parquet", 1),
    ],
)
def test_a_killed_run_goes_on_and_gives_the_same_bytes(
    tmp_path: Path, undisturbed: dict[str, bytes], pattern: str, count: int
) -> None:
    kill_when(start(tmp_path), tmp_path, pattern, count)
    assert finish(tmp_path) == undisturbed
    assert not list(tmp_path.glob("archive/**/.tmp-*"))


@pytest.mark.slow
def test_a_run_killed_again_and_again_comes_to_its_end(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    for records in (2, 5, 11, 17):
        kill_when(start(tmp_path), tmp_path, "archive/captures/*/[0-9]*/record.json", records)
    assert finish(tmp_path) == undisturbed
