"""Every figure of docs/reference/measured.md in a short form: `python -m benchmarks`; `--full` as published."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent

# benchmark, arguments of the short form, arguments of the published form
BENCHMARKS: tuple[tuple[str, tuple[str, ...], tuple[str, ...]], ...] = (
    ("main_job.py", ("--way", "direct"), ()),
    ("station.py", ("--short", "--only", "lots", "--only", "soaks", "--only", "noise"), ()),
    ("fits.py", ("--units", "200", "--rounds", "3"), ()),
    ("allan.py", ("--channels", "6", "--minutes", "10"), ()),
    ("budget.py", ("--units", "40"), ("--units", "304")),
    ("exceedance.py", ("--units", "48"), ()),
    ("recovery.py", ("--units", "50"), ("--units", "200")),
    ("throughput.py", ("--rounds", "5"), ("--rounds", "25")),
    ("plans.py", ("--units", "50", "--device", "adxl355"), ()),
    ("archive.py", ("--lots", "50", "--lots", "200"), ("--lots", "100", "--lots", "1000", "--lots", "10000")),
    ("compaction.py", ("--lots", "50"), ("--lots", "1000")),
    ("refit.py", ("--units", "200"), ("--units", "1000", "--units", "10000")),
    ("diagnosis.py", (), ("--lot", "null_8", "--lot", "cubic_8", "--lot", "hysteresis_8", "--lot", "null_60",
                          "--lot", "null_200")),
    ("investigate.py", ("--scene", "cubic on 18", "--scene", "pendulum on faces"), ("--seeds", "3", "--first", "31")),
    ("blind.py", ("--runs", "40"), ("--runs", "400", "--method", "tumbleline", "--method", "bic", "--method", "bonferroni",
                                    "--method", "stlsq", "--method", "lasso")),
)  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--full", action="store_true", help="as published: many minutes")
    parser.add_argument("--only", action="append", choices=[name.removesuffix(".py") for name, _, _ in BENCHMARKS])
    options = parser.parse_args()
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    failed: list[str] = []
    for name, short, full in BENCHMARKS:
        if options.only and name.removesuffix(".py") not in options.only:
            continue
        arguments = full if options.full else short
        print(f"== python benchmarks/{' '.join([name, *arguments])}", flush=True)
        start = time.perf_counter()
        done = subprocess.run([sys.executable, str(HERE / name), *arguments], check=False, env=environment)
        print(f"-- {time.perf_counter() - start:.0f} s\n", flush=True)
        failed += [name] if done.returncode else []
    if failed:
        print(f"benchmarks: {', '.join(failed)} ended with an error; run it alone to see why", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
