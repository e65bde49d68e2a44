"""The audit of an archive from a cold disk, before and after compaction: `python benchmarks/compaction.py --lots 10000`.

An archive of lots of ten units is generated (`generated_archive.py`), with its ledger and with the seal of every run. The audit
is measured as a complete process, without an index and with one, after the file caches of the system were dropped and again at
once; then the archive is compacted, and the same follows. Bytes are those that came from the disk. Caches are dropped by root
only; without this right warm times are printed.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.archive import UNTIL, prepared  # noqa: E402 - run as a script from any folder
from benchmarks.family_memory import family_bytes  # noqa: E402
from pipelines.archive import Archive, Run  # noqa: E402

MB = 2.0**20
POLL_S = 0.1
CACHES = Path("/proc/sys/vm/drop_caches")


class Spent(NamedTuple):
    """What a command took: times, s; bytes from the disk; largest memory of all its processes together, bytes."""

    wall_s: float
    processor_s: float
    from_disk: float
    memory: float
    output: str


def spent(*arguments: str) -> Spent:
    """A command of the product in a process of its own."""
    before, start, most = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter(), 0.0
    with tempfile.TemporaryFile("w+") as out:
        command = [sys.executable, "-m", "pipelines.cli", *arguments]
        with subprocess.Popen(command, cwd=ROOT, stdout=out, stderr=subprocess.PIPE, text=True) as process:
            lines: list[str] = []
            reader = threading.Thread(target=lambda: lines.extend(process.stderr or ()))
            reader.start()
            while process.poll() is None:
                most = max(most, family_bytes(process.pid))
                time.sleep(POLL_S)
            reader.join()
        if process.returncode not in {0, 1}:
            sys.exit(f"compaction: tumbleline {arguments[0]} ended with {process.returncode}: {''.join(lines)[-500:]}")
        out.seek(0)
        text = out.read()
    seconds, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Spent(seconds, processor, 512.0 * (after.ru_inblock - before.ru_inblock), most, text)


def seal_all(folder: Path) -> None:
    """Seal every run, as its publisher does."""
    archive = Archive(folder)
    for run_id in archive.run_ids():
        Run(archive, run_id).seal()


def age(folder: Path) -> None:
    """Make the events of the ledger two hours old: younger ones are not compacted."""
    then = time.time() - 7200.0
    for place in (folder / "calibrations").rglob("*.json"):
        os.utime(place, (then, then))


def count_files(folder: Path) -> int:
    """Files of the archive without its index."""
    return sum(len(names) for top, _, names in os.walk(folder) if f"{os.sep}index" not in top.removeprefix(str(folder)))


def cooled() -> bool:
    """Whether the file caches of the system could be dropped."""
    os.sync()
    try:
        CACHES.write_text("3", encoding="ascii")
    except OSError:
        return False
    return True


def line(what: str, took: Spent) -> None:
    load = f"load {os.getloadavg()[0]:.1f}"
    print(f"  {what:<34} {took.wall_s:7.1f} s   {took.processor_s:7.1f} s processor   {took.from_disk / MB:7.0f} MB from disk   "
          f"{took.memory / MB:5.0f} MB   {load}", flush=True)  # fmt: skip


def audits(folder: Path, workers: int, when: str) -> set[str]:
    """The four audits of an archive; their different outputs."""
    words = ("audit", "--archive", str(folder), "--until", UNTIL, "--json", "--workers", str(workers))
    texts: set[str] = set()
    for index in (False, True):
        for cold in (True, False):
            if not index:
                shutil.rmtree(folder / "index", ignore_errors=True)
            if cold and not cooled():
                print("  (caches cannot be dropped without the rights of root: no cold times)")
                continue
            took = spent(*words)
            texts.add(took.output)
            line(f"{when}, {'with' if index else 'no'} index, {'cold' if cold else 'warm'}", took)
    return texts


def same(one: Any, other: Any) -> bool:
    """Whether two documents agree; numbers to rounding: an index made from packs has its rows in the order of the packs."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same(value, other[key]) for key, value in one.items())
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-12)
    return bool(one == other)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lots", type=int, default=1000, help="lots of ten units")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--folder", type=Path, help="folder for the archive, which is kept; a temporary one by default")
    options = parser.parse_args()
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    with tempfile.TemporaryDirectory(prefix="tumbleline-compaction-") as spare:
        folder = (options.folder or Path(spare)) / f"lots-{options.lots}"
        prepared(options.lots, folder, options.workers)
        seal_all(folder)
        age(folder)
        files = count_files(folder)
        print(f"{options.lots} lots of ten units, {files} files")
        texts = audits(folder, options.workers, "single files")
        took = spent("archive", "compact", "--archive", str(folder), "--json")
        line("compaction", took)
        print(f"  files {files} → {count_files(folder)}, {len(list((folder / 'packed').glob('*.zip')))} packs")
        texts |= audits(folder, options.workers, "packs")
    first, *others = (json.loads(text) for text in texts)
    if not all(same(first, other) for other in others):
        sys.exit("compaction: two audits of the same archive differ")
    return 0


if __name__ == "__main__":
    sys.exit(main())
