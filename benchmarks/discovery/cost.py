"""What a night costs on an archive of many lots: scores and runs of sixty lots are written again under other names."""

from __future__ import annotations

import json
import resource
import shutil
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipelines.archive import Archive, derived, files
from pipelines.demo.archive_lots import Line, write_lots, write_run
from pipelines.discovery.discover import Look, discovered
from pipelines.discovery.lot_source import DiscoveryArchive
from pipelines.discovery.score_store import written

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
        begin = time.perf_counter()
        discovered(archive, Look())
        print(f"first look at {lots} lots: {time.perf_counter() - begin:.1f} s")
        line = Line(seed + 1, hidden=None)
        for number in range(NIGHT):
            dwells, about = line.lot("line-1")
            for table in (dwells, about):
                table["unit"] = "N" + table["unit"]
            write_run(archive, 10**6 + number, "line-1", dwells, about)
        begin = time.perf_counter()
        discovered(Archive(str(made.folder)), Look())
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        print(f"a night of {NIGHT} lots: {time.perf_counter() - begin:.1f} s; peak memory {memory:.0f} MB")


def _copies(folder: Path, count: int, seed: int) -> None:
    """Runs with other names, days and serials, and the scores of them with other signs."""
    source = DiscoveryArchive(Archive(str(folder)))
    products = source.store.products[0]
    runs = [source.store.run(run) for run in source.store.place]
    rng = np.random.default_rng(seed)
    new = []
    for number in range(count):
        one = runs[number % REAL]
        if one.score is None or one.station_scores is None:
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
        scores = {
            "score": sign * one.score,
            "station_scores": np.stack([sign * one.station_scores[0], one.station_scores[1]]),
        }
        averages = {"lot": products.lot, "inside": products.inside, "size": products.size}
        new.append(replace(one, run=name, when=about["when"], units=units, **scores, **averages))
    for at in range(0, count, A_FILE):
        place = folder / "discovery" / "scores" / f"{at // A_FILE + 2:06d}.scores"
        files.publish(place, derived.framed(written(new[at : at + A_FILE])))
