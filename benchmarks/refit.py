"""Re-fit and re-grade of an archive with another model, 10 000 units × 72 dwells: `python benchmarks/refit.py`.

An archive of lots of ten units is generated (see generated_archive.py), then run again with the present program by two worker
processes of one BLAS thread each, once in memory only (as in `tumbleline release whatif`), once with all tables written
(`tumbleline rerun`). For comparison, in the same processes on the same files: the time to read the tables of a fit and to solve
one weighted batch fit per lot. Memory is the largest total of the parent and its workers. `--units` may be
repeated, for the cost by number of units. `--stages` prints the processor time of every step.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Self

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from benchmarks.family_memory import family_bytes  # noqa: E402
from inertial.fits.linear import fit_lot  # noqa: E402
from pipelines.archive import Archive, Run  # noqa: E402
from pipelines.jobs.model_change import ModelChange, change_from_options  # noqa: E402
from pipelines.parallel import map_partitions, one_thread_each  # noqa: E402
from pipelines.rerun import lot_comparison  # noqa: E402
from pipelines.rerun.lot_comparison import judged  # noqa: E402
from pipelines.rerun.partition import Batch, parts, run_again  # noqa: E402
from pipelines.tables.dwells import lot_arrays  # noqa: E402

PER_LOT = 10
MB = 1024.0
POLL_S = 0.2
WARM = 3  # lots before the measurement: imports and first calls
ROUNDS = 5  # of each lot: other load makes a call slower, never faster
STEPS = {
    "table": "reading of nine tables", "archived_job": "job of the run", "fit_in_memory": "fit", "verify_tables": "verify",
    "decision_budget": "budget", "grade": "grade", "_side": "errors and outcomes of both sides",
}  # fmt: skip
EFFECTS = (
    *("bias", "scale", "misalignment", "bias_temperature", "bias_temperature_quadratic"),
    *("scale_temperature", "scale_temperature_quadratic"),
)


def bare(part: Batch) -> int:
    """Read the tables of a fit for every lot of a batch, and solve it once; the number of units."""
    archive, units = Archive(part.archive), 0
    for run_id in part.runs:
        run = Run(archive, run_id)
        dwells, history = run.table("dwells"), run.table("history")
        for name in ("verdicts", "noise"):
            run.table(name)
        lot = lot_arrays(dwells, history)
        error = np.where(lot.of_kind("dwell")[:, None], lot.standard_error, np.inf)
        fit_lot(EFFECTS, lot.state, lot.output, error)
        units += len(lot.units)
    return units


class Memory:
    """The largest total resident memory of this process and its children during a block, MB."""

    def __enter__(self) -> Self:
        self.most, self._stop = 0.0, threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._stop.wait(POLL_S):
            self.most = max(self.most, family_bytes(os.getpid()) / MB / MB)


def used() -> float:
    """Processor time of this process and of its ended children, s."""
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def timed(what: str, function: object, archive: Archive, change: ModelChange, workers: int) -> tuple[float, float]:
    """Wall time and processor time for all runs, s; prints them."""
    runs = archive.run_ids()
    with Memory() as memory:
        start, before = time.perf_counter(), used()
        done = map_partitions(function, parts(archive, runs, change, workers), workers=workers)  # type: ignore[arg-type]
        seconds, cpu = time.perf_counter() - start, used() - before
    failed = [one.error for portion in done if isinstance(portion, list) for one in portion if one.error]
    if failed:
        sys.exit(f"refit: {what}: {len(failed)} runs failed: {failed[0]}")
    per_lot = 1e3 * seconds / len(runs)
    print(f"{what:<34} {seconds:7.1f} s   {cpu:7.1f} s processor   {per_lot:6.1f} ms per lot   {memory.most:6.0f} MB")
    return seconds, cpu


def generate(place: Path, units: int) -> None:
    """The archive of so many units, in a process of its own."""
    script = ROOT / "benchmarks" / "generated_archive.py"
    command = [sys.executable, str(script), str(place), "--lots", str(units // PER_LOT)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def measured(units: int, workers: int, folder: Path) -> None:
    """All three measurements on an archive with this number of units."""
    place = folder / f"{units}"
    generate(place, units)
    archive, change = Archive(place), change_from_options(",".join(EFFECTS))
    print(f"{units} units in {units // PER_LOT} lots × 72 dwells of the fit, {workers} processes of one thread")
    read, read_cpu = timed("reading and solution", bare, archive, ModelChange(), workers)
    memory, memory_cpu = timed("re-fit and re-grade in memory", judged, archive, change, workers)
    whole, whole_cpu = timed("re-fit and re-grade, tables written", run_again, archive, change, workers)
    for what, seconds, cpu in (("in memory", memory, memory_cpu), ("all written", whole, whole_cpu)):
        print(f"  ratio {what}: {seconds / read:.1f} wall time, {cpu / read_cpu:.1f} processor time")
    shutil.rmtree(place)


def by_stage(units: int, folder: Path) -> None:
    """Processor time per lot of every step of a re-fit in memory; each step runs as the product calls it."""
    place = folder / f"{units}"
    generate(place, units)
    archive, change = Archive(place), change_from_options(",".join(EFFECTS))
    spent: dict[str, float] = dict.fromkeys(STEPS, 0.0)
    depth = [0]

    def watched(name: str, function: Any) -> Any:
        def call(*arguments: Any, **named: Any) -> Any:
            depth[0] += 1
            start = time.process_time()
            try:
                return function(*arguments, **named)
            finally:
                depth[0] -= 1
                if not depth[0]:  # a step within another one is part of that
                    spent[name] += time.process_time() - start

        return call

    owners = {name: Run if name == "table" else lot_comparison for name in STEPS}
    before = {name: getattr(owner, name) for name, owner in owners.items()}
    for portion in parts(archive, archive.run_ids()[:WARM], change, 1):
        judged(portion)
        bare(portion)
    runs = archive.run_ids()[WARM:]
    for name, owner in owners.items():
        setattr(owner, name, watched(name, before[name]))
    least: dict[tuple[str, str], float] = {}
    try:
        for run, _ in product(runs, range(ROUNDS)):
            alone = _seconds(bare, Batch(archive.address, (run,)))
            spent.update(dict.fromkeys(STEPS, 0.0))
            whole = _seconds(judged, Batch(archive.address, (run,), change))
            rest = whole - sum(spent.values())
            for name, seconds in {**spent, "rest": rest, "all": whole, "reading and solution": alone}.items():
                least[run, name] = min(least.get((run, name), seconds), seconds)
    finally:
        for name, owner in owners.items():
            setattr(owner, name, before[name])
    print(f"{len(runs)} lots, one process, ms of processor time per lot, the least of {ROUNDS} rounds of each lot, "
          f"load {os.getloadavg()[0]:.1f}")  # fmt: skip
    lines = {name: sum(least[run, name] for run in runs) for name in dict.fromkeys(name for _, name in least)}
    for name, seconds in lines.items():
        what = STEPS.get(name, name)
        print(f"  {what:<34} {1e3 * seconds / len(runs):7.1f}   {100.0 * seconds / lines['all']:4.0f} %")
    print(f"  ratio {lines['all'] / lines['reading and solution']:.1f}")
    shutil.rmtree(place)


def _seconds(function: Callable[[Batch], object], batch: Batch) -> float:
    """Processor time of a call, s."""
    start = time.process_time()
    function(batch)
    return time.process_time() - start


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--units", type=int, action="append", help="units in the archive; 10000 by default")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--stages", action="store_true", help="processor time of every step instead, in one worker process"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="tumbleline-refit-") as folder:
        for units in options.units or [10000]:
            if options.stages:
                with one_thread_each(), ProcessPoolExecutor(1, mp_context=get_context("spawn")) as worker:
                    worker.submit(by_stage, units, Path(folder)).result()  # in a process like those of the product
            else:
                measured(units, options.workers, Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
