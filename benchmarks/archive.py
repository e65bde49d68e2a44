"""The archive at the size of a factory: `python benchmarks/archive.py --lots 100 --lots 1000 --lots 10000`.

It generates archives with the given numbers of lots (ten units each, `generated_archive.py`), each with its ledger. It
measures complete processes as a user starts them: the valid calibration of a serial on a date, the audit of the complete
archive (with creation of the index, and with an existing index), and rows per second of an SQL query over the files of the
runs and over the index, compared with pyarrow.dataset on the same files. Finally it prints the growth of the times with the
size.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.generated_archive import PER_LOT, write_archive  # noqa: E402 - run as a script from any folder
from benchmarks.generated_ledger import write_ledger  # noqa: E402
from benchmarks.main_job import resident  # noqa: E402

UNTIL = "2026-01-04"
LOOKUPS = 9
QUESTION = "SELECT effect, axis, count(*) AS n, avg(value) AS mean FROM coefficients GROUP BY ALL ORDER BY ALL"
MB = 2.0**20
TEN_MILLION = 10_000_000


@dataclass
class Size:
    """Measured values of one archive; times in s, memory in bytes."""

    lots: int
    calibrations: int = 0
    files: int = 0
    bytes_on_disk: int = 0
    index_bytes: int = 0
    made_s: float = float("nan")
    lookups_s: list[float] = field(default_factory=list)
    first_audit_s: float = 0.0
    first_audit_cpu_s: float = 0.0
    audit_s: float = 0.0
    audit_cpu_s: float = 0.0
    audit_bytes: int = 0
    rows: int = 0
    rates: dict[str, float] = field(default_factory=dict)


def timed(*arguments: str) -> tuple[float, int, str]:
    """Wall time of a command in its own process, its peak memory, and its output."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with tempfile.TemporaryFile("w+") as out:
        start = time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, "-m", "pipelines.cli", *arguments],
            cwd=ROOT,
            env=environment,
            stdout=out,
            stderr=subprocess.PIPE,
        )
        peak = 0
        while process.poll() is None:
            peak = max(peak, resident(process.pid))
            time.sleep(0.01)
        seconds = time.perf_counter() - start
        errors = process.stderr.read().decode() if process.stderr else ""
        if process.returncode not in {0, 1}:
            raise RuntimeError(
                f"archive: tumbleline {arguments[0]} ended with status {process.returncode}: {errors[-1000:]}"
            )
        out.seek(0)
        return seconds, peak, out.read()


def children_cpu() -> float:
    """Processor time of all ended child processes, s: their wall time on one core without other load."""
    spent = os.times()
    return spent.children_user + spent.children_system


def prepared(lots: int, folder: Path, workers: int) -> Size:
    """The archive of a size with its ledger; it is generated where it does not exist."""
    size = Size(lots)
    if not folder.exists():
        start = time.perf_counter()
        write_archive(folder, lots, workers=workers)
        size.made_s = time.perf_counter() - start
    if not (folder / "calibrations").is_dir():
        write_ledger(folder, _passed(folder))
    for path in folder.rglob("*"):
        if path.is_file() and "index" not in path.relative_to(folder).parts[:1]:
            size.files += 1
            size.bytes_on_disk += path.stat().st_size
    return size


def _passed(folder: Path) -> list[tuple[str, str, str, str, str]]:
    from pipelines.archive import Archive
    from pipelines.audit.sql import ask

    question = (
        "SELECT unit, device, run, station, left(measured, 10) FROM units JOIN runs USING (run) "
        "WHERE outcome = 'pass' AND NOT starts_with(unit, 'CS-') ORDER BY measured, run, unit"
    )
    return [tuple(str(value) for value in row) for row in ask(Archive(folder), question).rows]  # type: ignore[misc]


def measure(size: Size, folder: Path, workers: int) -> None:
    """Times of one archive."""
    where = ("--archive", str(folder))
    audit = ("audit", *where, "--until", UNTIL, "--json", "--workers", str(workers))
    shutil.rmtree(folder / "index", ignore_errors=True)
    before = children_cpu()
    size.first_audit_s, _, first = timed(*audit)
    between = children_cpu()
    size.audit_s, size.audit_bytes, second = timed(*audit)
    size.first_audit_cpu_s, size.audit_cpu_s = between - before, children_cpu() - between
    if first != second:
        raise RuntimeError("archive: two audits of the same archive differ")
    size.calibrations = json.loads(first)["counts"]["calibrations"]
    size.index_bytes = sum(path.stat().st_size for path in (folder / "index").rglob("*.parquet"))
    for k in range(LOOKUPS):
        pool = max(3, size.lots // 20)
        serial = f"P{(k * 7) % pool:05d}-{k % PER_LOT}"
        size.lookups_s.append(timed("show", serial, "--at", "2023-06-15", *where, "--json")[0])
    size.rates = rates(size, folder)


def rates(size: Size, folder: Path) -> dict[str, float]:
    """Rows of coefficients per second for each method, with loaded libraries; all methods must give the same result."""
    import pyarrow.dataset as ds

    from pipelines.archive import Archive
    from pipelines.audit.sql import ask

    archive, out = Archive(folder), {}
    files = sorted(str(path) for path in folder.glob("runs/*/coefficients.parquet"))

    def plain() -> int:
        table = ds.dataset(files, format="parquet").to_table(columns=["effect", "axis", "value"])
        groups = table.group_by(["effect", "axis"]).aggregate([("value", "mean"), ("value", "count")])
        return sum(groups.column("value_count").to_pylist())

    def query(*, compact: bool) -> int:
        return sum(row[2] for row in ask(archive, QUESTION, compact=compact).rows)

    ways = {
        "pyarrow.dataset, files of the runs": plain,
        "query --no-index, files of the runs": lambda: query(compact=False),
        "query, the index": lambda: query(compact=True),
    }
    for name, way in ways.items():
        times, count = [], 0
        for _ in range(3):
            start = time.perf_counter()
            count = way()
            times.append(time.perf_counter() - start)
        if size.rows not in {0, count}:
            raise RuntimeError(f"archive: {name} counts {count} rows, {size.rows} are needed")
        size.rows = count
        out[name] = count / min(times)
    return out


def show(size: Size) -> None:
    """Prints the measured values of one archive."""
    made = f", made in {size.made_s:.0f} s" if math.isfinite(size.made_s) else ""
    print(
        f"\n{size.lots} lots, {size.calibrations} calibrations: {size.files} files, {size.bytes_on_disk / MB:.0f} MB{made}; "
        f"index {size.index_bytes / MB:.0f} MB"
    )
    print(
        f"  validity of a serial on a date   {statistics.median(size.lookups_s):6.2f} s, worst of {LOOKUPS} "
        f"{max(size.lookups_s):.2f} s, complete process"
    )
    print(
        f"  audit of the complete archive    {size.audit_s:6.1f} s ({size.audit_cpu_s:.1f} s processor time), peak "
        f"memory {size.audit_bytes / MB:.0f} MB"
    )
    print(
        f"  … including creation of index    {size.first_audit_s:6.1f} s ({size.first_audit_cpu_s:.1f} s processor time)"
    )
    base = next(iter(size.rates.values()))
    for name, rate in size.rates.items():
        print(f"  {name:<33}{rate / 1e6:6.2f} million rows per second, {rate / base:.1f} × pyarrow.dataset")
    sys.stdout.flush()


def growth(sizes: list[Size]) -> None:
    """Prints the growth of the times, and the extrapolation to ten million calibrations at the rates of the largest archive."""
    if len(sizes) < 2:
        return
    first, last = sizes[0], sizes[-1]
    span = math.log(last.calibrations / first.calibrations)
    print("\ngrowth: time ∝ size^k, from the smallest to the largest archive (k = 1 is linear)")
    for name, of in (
        ("audit", lambda s: s.audit_s),
        ("audit including its index", lambda s: s.first_audit_s),
        ("validity", lambda s: statistics.median(s.lookups_s)),
    ):
        print(f"  {name:<28} k = {math.log(of(last) / of(first)) / span:.2f}")
    before = sizes[-2]
    step = last.calibrations - before.calibrations
    index = (last.first_audit_s - last.audit_s - before.first_audit_s + before.audit_s) / step
    audit = (last.audit_s - before.audit_s) / step
    print(f"per calibration beyond {before.calibrations}: index {1e3 * index:.2f} ms, audit {1e3 * audit:.3f} ms, "
          f"{last.bytes_on_disk / last.calibrations / 1024:.1f} kB and {last.files / last.calibrations:.1f} files; "
          f"ten million: index {TEN_MILLION * index / 3600:.1f} h once, audit {TEN_MILLION * audit / 60:.0f} min, "
          f"{TEN_MILLION * last.bytes_on_disk / last.calibrations / 2**40:.2f} TB, "
          f"memory {TEN_MILLION * last.audit_bytes / last.calibrations / 2**30:.0f} GB")  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--lots", type=int, action="append", help="lots of an archive (repeatable); 100 and 1000 by default"
    )
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--folder", type=Path, help="folder for the archives, which are kept; a temporary folder by default"
    )
    options = parser.parse_args()
    sizes: list[Size] = []
    with tempfile.TemporaryDirectory(prefix="tumbleline-archive-") as spare:
        base = options.folder or Path(spare)
        for lots in sorted(options.lots or [100, 1000]):
            folder = base / f"lots-{lots}"
            size = prepared(lots, folder, options.workers)
            measure(size, folder, options.workers)
            show(size)
            sizes.append(size)
    growth(sizes)
    return 0


if __name__ == "__main__":
    sys.exit(main())
