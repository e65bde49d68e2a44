"""Re-runs from the command line: here, in several processes and on a Dask cluster, with the same bytes everywhere."""

import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from capture_double import CaptureDouble, small_job, small_run

from pipelines.archive import Archive
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner

LINEAR = "bias,scale,misalignment,bias_temperature,scale_temperature"
LARGER = f"{LINEAR},third_order"
ALONE = ("--workers", "1")


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive of a line of three runs."""
    folder = tmp_path_factory.mktemp("commands")
    small_run(folder)
    for repeat in (1, 2):
        runner = Runner(small_job(folder, repeat=repeat), Archive(folder / "archive"), measure=CaptureDouble())
        for stage in ORDER[:-1]:
            runner.stage(stage)
    return folder / "archive"


@pytest.fixture
def own(archive: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(archive, tmp_path / "archive"))


def process_of(archive: Path, *how: str) -> subprocess.Popen[bytes]:
    """A re-run of everything in a process of its own, in which nothing is loaded or patched."""
    words = [sys.executable, "-m", "pipelines.cli", "rerun", "all", "--effects", LARGER, "--archive", str(archive)]
    return subprocess.Popen([*words, *how], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def tables(archive: Path) -> dict[str, bytes]:
    return {str(path.relative_to(archive)): path.read_bytes() for path in sorted(archive.glob("runs/*/*.parquet"))}


@pytest.mark.slow
def test_two_processes_and_a_dask_cluster_give_the_same_bytes(archive: Path, tmp_path: Path) -> None:
    made: list[dict[str, bytes]] = []
    for number, how in enumerate((ALONE, ("--workers", "2"), ("--dask", "local", "--workers", "2"))):
        own = Path(shutil.copytree(archive, tmp_path / str(number)))
        assert process_of(own, *how).wait(240) == 0
        made.append(tables(own))
    assert len(made[0]) == 2 * len(tables(archive))
    assert made[0] == made[1] == made[2]


@pytest.mark.slow
def test_a_rerun_that_was_killed_goes_on(own: Path, archive: Path, tmp_path: Path) -> None:
    whole = Path(shutil.copytree(archive, tmp_path / "whole"))
    assert process_of(whole, *ALONE).wait(240) == 0
    killed, end = process_of(own, *ALONE), time.monotonic() + 60.0
    while len(list((own / "runs").glob("*/*.parquet"))) < 3 * 17 + 12 and time.monotonic() < end:
        time.sleep(0.01)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    assert process_of(own, *ALONE).wait(240) == 0
    assert tables(own) == tables(whole)
