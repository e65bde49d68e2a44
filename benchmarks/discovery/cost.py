"""What a night costs on an archive of many lots: scores and runs of sixty lots are written again under other names."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipelines.archive import Archive, derived, files
from pipelines.demo.archive_lots import Line, write_lots, write_run
from pipelines.discovery.lot_source import DiscoveryArchive
from pipelines.discovery.score_store import written
from pipelines.discovery.scored_run import ScoredRun

REAL, A_FILE, NIGHT = 60, 500, 20


def cost(lots: int, seed: int) -> None:
    """Print the seconds of scores, of the first look at all lots, and of a night of twenty."""
    with tempfile.TemporaryDirectory() as folder:
        made = write_lots(Path(folder), Line(seed, hidden=None), REAL)
        archive = Archive(str(made.folder))
        begin = time.perf_counter()
        DiscoveryArchive(archive).score(1)
        print(f"scores of a lot: {1e3 * (time.perf_counter() - begin) / REAL:.0f} ms, with the reading of its dwells")
        kept = sum(place.stat().st_size for place in (made.folder / "discovery" / "scores").iterdir())
        print(f"on disk: {kept / REAL:.0f} bytes a lot")
        _copies(made.folder, lots - REAL, seed)
        seconds, memory = _looked(made.folder)
        print(f"first look at {lots} lots: {seconds:.1f} s; peak memory {memory:.0f} MB", flush=True)
        line = Line(seed + 1, hidden=None)
        for number in range(NIGHT):
            dwells, about = line.lot("line-1")
            for table in (dwells, about):
                table["unit"] = "N" + table["unit"]
            write_run(archive, 10**6 + number, "line-1", dwells, about)
        seconds, memory = _looked(made.folder)
        print(f"a night of {NIGHT} lots: {seconds:.1f} s; peak memory {memory:.0f} MB")


def _looked(folder: Path) -> tuple[float, float]:
    """Seconds and peak memory, MB, of the command in a process of its own."""
    peak = "import atexit, pathlib; atexit.register(lambda: print(pathlib.Path('/proc/self/status').read_text()))"
    call = f"{peak}; import sys; from pipelines.cli import main; sys.exit(main())"
    begin = time.perf_counter()
    command = [sys.executable, "-c", call, "discover", "--archive", str(folder), "--workers", "1", "--json"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    seconds = time.perf_counter() - begin
    lines = [line for line in done.stdout.splitlines() if line.startswith("VmHWM")]
    if done.returncode not in {0, 1}:
        raise RuntimeError(done.stderr)
    return seconds, float(lines[0].split()[1]) / 1e3


def _copies(folder: Path, count: int, seed: int) -> None:
    """Runs with other names, days and serials, and the scores of them with other signs."""
    source = DiscoveryArchive(Archive(str(folder)))
    runs = [source.store.run(run) for run in source.store.heads]
    rng = np.random.default_rng(seed)
    new: list[ScoredRun] = []
    for number in range(count):
        one = runs[number % REAL]
        if one.scores is None:
            raise RuntimeError(one.run)
        name, sign = f"copy-{number:010x}", float(rng.choice([-1.0, 1.0]))
        place = folder / "runs" / name
        shutil.copytree(folder / "runs" / one.run, place)
        about = json.loads((place / "run.json").read_text(encoding="utf-8"))
        day = f"{2027 + number // 5000}-{1 + number // 420 % 12:02d}-{1 + number // 20 % 21:02d}"
        about["when"] = f"{day}T{number % 20:02d}:00:00+00:00"
        units = tuple(f"U{number}-{k}" for k in range(len(one.units)))
        for unit, serial in zip(about["lot"]["units"], units, strict=True):
            unit["serial"] = serial
        (place / "run.json").write_text(json.dumps(about), encoding="utf-8")
        of_station = one.scores.of_station * np.array([[sign], [1.0]])
        scores = replace(one.scores, score=sign * one.scores.score, of_station=of_station)
        new.append(replace(one, run=name, when=about["when"], units=units, scores=scores))
        if len(new) == A_FILE or number == count - 1:
            scores_file = folder / "discovery" / "scores" / f"{number // A_FILE + 2:06d}.scores"
            files.publish(scores_file, derived.framed(written(new)))
            new.clear()
