"""Processor time and memory of `tumbleline diagnose`, process by process: `python benchmarks/diagnosis.py --lot null_8`.

The lots are those of benchmarks/worlds: 24 poses four times in three soaks, 288 dwells a unit; of `hysteresis`, 18 poses four
times in four soaks. With `--before FOLDER`, another tree of the sources, each is diagnosed by it, too, in turns: the machine is
as busy for the one as for the other.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "worlds"), str(HERE.parent)]

from world import World, make  # noqa: E402

SEED = 87_055_123
CUBIC, HYSTERESIS = (("third_order", 2.0),), (("thermal_hysteresis", 2.0),)
LOTS: dict[str, World] = {
    "null_8": World(repeats=4),
    "cubic_8": World(repeats=4, hidden=CUBIC),
    "hysteresis_8": World(poses=18, repeats=4, soaks=(25.0, 60.0, -10.0, 25.0), hidden=HYSTERESIS),
    "null_60": World(units=60, repeats=4),
    "cubic_60": World(units=60, repeats=4, hidden=CUBIC),
    "null_200": World(units=200, repeats=4),
    "cubic_200": World(units=200, repeats=4, hidden=CUBIC),
}
SHORT = ("null_8", "cubic_8")


def diagnosed(root: Path, dwells: Path) -> tuple[float, float, float, dict[str, object]]:
    """Processor time, s, time, s, and peak memory, MB, of the command by the sources of a folder; and its document."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command = [sys.executable, "-c", _COMMAND, "diagnose", str(dwells), "--json"]
    done = subprocess.run(
        command, cwd=root, env={**os.environ, "PYTHONPATH": str(root)}, check=False, stdout=subprocess.PIPE
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    document, _, peak = done.stdout.decode().rpartition("\n")
    return used, time.perf_counter() - begin, float(peak) / 1024.0, json.loads(document)


_COMMAND = """
import atexit, pathlib, sys

def peak():  # not ru_maxrss, which begins with the memory of the process that started this one
    lines = pathlib.Path("/proc/self/status").read_text().splitlines()
    print(next(line.split()[1] for line in lines if line.startswith("VmHWM")), end="")

atexit.register(peak)
from pipelines.cli import main
sys.exit(main())
"""


def main() -> int:
    """Print a line for every lot."""
    parser = argparse.ArgumentParser(prog="python benchmarks/diagnosis.py", description=__doc__)
    parser.add_argument("--lot", action="append", choices=LOTS, default=[])
    parser.add_argument("--before", type=Path)
    options = parser.parse_args()
    roots = [*([options.before.resolve()] if options.before else []), HERE.parent]
    with tempfile.TemporaryDirectory() as folder:
        for name in options.lot or SHORT:
            made = make(LOTS[name], SEED)
            dwells = Path(folder) / f"{name}.parquet"
            made.dwells.to_parquet(dwells)
            made.history.to_parquet(dwells.with_name(f"{name}-history.parquet"))
            for root in roots:
                used, spent, peak, document = diagnosed(root, dwells)
                classes = [c["effects"] for c in document["classes"]]  # pyright: ignore[reportGeneralTypeIssues]
                label = "before" if root != HERE.parent else ""
                print(
                    f"{name:14s} {label:6s} {used:6.1f} s of processor time, {spent:6.1f} s at load {os.getloadavg()[0]:.1f}, "
                    f"{peak:4.0f} MB; adequate {document['adequate']}, {classes}",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
