"""Every benchmark of docs/reference/measured.md in a short form: `python -m benchmarks`; `--full` as published there."""

from __future__ import annotations

import argparse
import os
import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/reference/measured.md"
COMMAND = re.compile(r"`python (?:benchmarks/(\w+)(?:\.py)?|-m benchmarks\.(\w+))((?: [^`]*)?)`")
FOLDER = "FOLDER"  # stands in the page for a folder of the reader's own; without it a benchmark takes a temporary one

# benchmark, arguments of its short form
SHORT: dict[str, str] = {
    "main_job": "--way direct",
    "station": "--short --only lots --only soaks --only noise",
    "fits": "--units 200 --rounds 3",
    "allan": "--channels 6 --minutes 10",
    "budget": "--units 40",
    "exceedance": "--units 48",
    "contradiction": "--lots 2 --size 1 --size 4",
    "recovery": "--units 50",
    "throughput": "--rounds 5",
    "plans": "--units 50 --device adxl355",
    "priors": "--units 24 --archive 100 --device adxl355 --world normal",
    "archive": "--lots 50 --lots 200",
    "compaction": "--lots 50",
    "refit": "--units 200",
    "workbench": "--units 20 --dwells 72 --calibrations 200",
    "diagnosis": "--lot null_8",
    "decision_rates": "--runs 2",
    "noise_verdicts": "verification --records 4",
    "bias_tracking": "--runs 2",
    "unscented": "--runs 2",
    "recordings": "--runs 4",
    "recording_intervals": "--runs 2",
    "record_faults": "--runs 8",
    "rest_and_motion": "--runs 1",
    "field": "--runs 1",
    "worlds": "nulls faults --runs 1",
    "blind": "--runs 40",
    "investigate": "--scene 'cubic on 18' --scene 'pendulum on faces'",
    "procedure_arrays": "20",
    "procedure_pulls": "shock turn_on --units 4",
    "procedure_equipment": "--units 4",
    "procedures": "naming 10",
    "rotation": "hidden --runs 5",
    "sweep_parameters": "12 1",
    "shock_and_spin": "centrifuge 9",
    "discovery": "names --archives 6",
    "scoreboard": "--seed 1 --share 0.1 --only hand",
    "hand_turned": "friction --runs 2",
    "line": "--lots 4 --most 2",
    "large_lots": "--runs 1 --sizes 1",
}


def published() -> dict[str, list[list[str]]]:
    """The arguments of every command of the page, by benchmark, in the order of the page."""
    found: dict[str, list[list[str]]] = {}
    for script, module, arguments in COMMAND.findall(PAGE.read_text(encoding="utf-8")):
        words = shlex.split(arguments)
        if FOLDER in words:
            place = words.index(FOLDER)
            del words[place - 1 : place + 1]
        commands = found.setdefault(script or module, [])
        if words not in commands:
            commands.append(words)
    return found


def call(name: str) -> list[str]:
    """What follows `python` for a benchmark: its file, its folder, or its module where it imports from its package."""
    if f"-m benchmarks.{name}`" in (page := PAGE.read_text(encoding="utf-8")) or f"-m benchmarks.{name} " in page:
        return ["-m", f"benchmarks.{name}"]
    return [f"benchmarks/{name}" if (ROOT / "benchmarks" / name).is_dir() else f"benchmarks/{name}.py"]


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--full", action="store_true", help="as published: many hours")
    parser.add_argument("--only", action="append", choices=list(SHORT))
    options = parser.parse_args()
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    failed: list[str] = []
    full = published()
    for name, short in SHORT.items():
        if options.only and name not in options.only:
            continue
        for arguments in full.get(name, [shlex.split(short)]) if options.full else [shlex.split(short)]:
            command = [*call(name), *arguments]
            print(f"== python {shlex.join(command)}", flush=True)
            start = time.perf_counter()
            done = subprocess.run([sys.executable, *command], check=False, env=environment, cwd=ROOT)
            print(f"-- {time.perf_counter() - start:.0f} s\n", flush=True)
            failed += [name] if done.returncode else []
    if failed:
        print(f"benchmarks: {', '.join(failed)} ended with an error; run it alone to see why", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
