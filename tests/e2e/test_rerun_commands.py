"""Re-runs from the command line: here, in several processes and on a Dask cluster, with the same bytes everywhere."""

import json
import os
import shutil
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pandas as pd
import pytest
from capture_double import CaptureDouble, small_job, small_run
from in_process import command

from pipelines.archive import Archive, parquet
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from schemas import tables as contracts

LARGER = "bias,scale,misalignment,bias_temperature,scale_temperature,third_order"


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("commands")
    small_run(folder)
    for repeat in (1, 2):
        runner = Runner(small_job(folder, repeat=repeat), Archive(folder / "archive"), measure=CaptureDouble())
        for stage in ORDER[:-1]:
            runner.stage(stage)
    return folder / "archive"


@pytest.fixture
def own(archive: Path, tmp_path: Path) -> Path:
    shutil.copytree(archive, tmp_path / "archive")
    return tmp_path / "archive"


def tumbleline(*words: str, status: int = 0, alone: bool = False) -> str:
    """What a command prints; ``alone`` gives it a process of its own, in which nothing is loaded or patched."""
    if alone:
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        whole = [sys.executable, "-m", "pipelines.cli", *words]
        done = subprocess.run(whole, capture_output=True, text=True, timeout=240, check=False, env=environment)
    else:
        done = command(words)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout if status != 2 else done.stderr


def tables(archive: Path) -> dict[str, bytes]:
    return {str(path.relative_to(archive)): path.read_bytes() for path in sorted(archive.glob("runs/*/*.parquet"))}


def test_reruns_of_all_runs_leave_the_old_ones_as_they_were(own: Path) -> None:
    before = tables(own)
    words = ("rerun", "all", "--effects", LARGER, "--archive", str(own), "--workers", "1")
    document = json.loads(tumbleline(*words, "--json"))
    assert (document["selected"], document["rerun"], document["failed"]) == (3, 3, 0)
    assert {name: content for name, content in tables(own).items() if name in before} == before
    assert "3 selected: 3 re-analysed" in tumbleline(*words)


def test_check_proves_the_archive_and_names_a_value_that_was_exchanged_with_its_hash(own: Path) -> None:
    words = ("rerun", "all", "--check", "--archive", str(own), "--workers", "1")
    assert "3 of 3 runs reproduced: 75 tables" in tumbleline(*words)
    run = Archive(own).runs()[0]
    place = own / "runs" / run.id
    figures = pd.read_parquet(place / "figures.parquet")
    figures.loc[2, "value"] += 1.0
    data = parquet.table_bytes("figures", figures, contracts.VERSION)
    (place / "figures.parquet").write_bytes(data)
    manifest = json.loads((place / "figures.json").read_text())
    (place / "figures.json").write_text(json.dumps(manifest | {"sha256": sha256(data).hexdigest()}))
    out = tumbleline(*words, status=1)
    assert "figures: value in 1 of" in out
    assert "2 of 3 runs reproduced" in out


def test_says_that_check_has_nothing_to_compare_another_model_with(own: Path) -> None:
    message = tumbleline("rerun", "all", "--check", "--effects", LARGER, "--archive", str(own), status=2)
    assert "--check with another model or limits has no stored result" in message


def test_whatif_release_and_list(own: Path, tmp_path: Path) -> None:
    model = tmp_path / "m.toml"
    effects = ", ".join(f'"{name}"' for name in LARGER.split(",")[:-1])  # what the lots were fitted with
    model.write_text(f'[model]\nname = "m"\nversion = 1\neffects = [{effects}]\n')
    words = ("--archive", str(own))
    out = tumbleline("whatif", str(model), *words, "--workers", "1", status=1)
    assert "adxl355 on simulated" in out
    refused = tumbleline("release", str(model), "--from", "2026-01-01", "--reason", "x", *words, status=2)
    assert "says no better" in refused
    record = json.loads(
        tumbleline("release", str(model), "--from", "2026-01-01", "--reason", "a trial", "--force", "--json", *words)
    )
    assert record["evidence"]
    listed = json.loads(tumbleline("release", "--list", "--json", *words))["releases"]
    assert [(row["model"], row["in_use"], row["forced"]) for row in listed] == [("m", True, True)]


@pytest.mark.slow
def test_two_processes_and_a_dask_cluster_give_the_same_bytes(archive: Path, tmp_path: Path) -> None:
    made: list[dict[str, bytes]] = []
    ways = (("--workers", "1"), ("--workers", "2"), ("--dask", "local", "--workers", "2"))
    for number, way in enumerate(ways):
        own = tmp_path / str(number)
        shutil.copytree(archive, own)
        document = json.loads(
            tumbleline("rerun", "all", "--effects", LARGER, "--archive", str(own), *way, "--json", alone=True)
        )
        assert document["rerun"] == 3
        made.append(tables(own))
    assert len(made[0]) == 2 * len(tables(archive))
    assert made[0] == made[1] == made[2]


@pytest.mark.slow
def test_a_rerun_that_was_killed_goes_on(own: Path, archive: Path, tmp_path: Path) -> None:
    import signal
    import time

    whole = tmp_path / "whole"
    shutil.copytree(archive, whole)
    words = ["rerun", "all", "--effects", LARGER, "--workers", "1"]
    tumbleline(*words, "--archive", str(whole), alone=True)
    killed = [sys.executable, "-m", "pipelines.cli", *words, "--archive", str(own)]
    process = subprocess.Popen(killed, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    end = time.monotonic() + 60.0
    while len(list((own / "runs").glob("*/*.parquet"))) < 3 * 17 + 12 and time.monotonic() < end:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    tumbleline(*words, "--archive", str(own), alone=True)
    assert tables(own) == tables(whole)
