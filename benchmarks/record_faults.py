"""Frozen and torn samples told, as a user sees it: files by hand-held placement, `python benchmarks/record_faults.py --runs 300`.

A sensor of 256 to 131072 LSB/g is turned by hand through 8 to 24 positions; three files in ten are printed in g. In every file
one fault is planted, and the file is read as `tumbleline inspect` reads it, knowing nothing of it:

frozen   an axis repeats a sample for half a dwell to a whole one
dead     an axis never changes, the others do
torn     on 6 to 11 % of the samples of an axis the two bytes are of different readings: off by ± 256 or 512 LSB
sound    nothing; what is told is false

Told means: the fault by its name on its axis and on no other, and for `frozen` within five samples of where it is.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
import tempfile
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any, cast

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))


import numpy as np  # noqa: E402
from scipy.stats import beta  # noqa: E402

from pipelines.importers.inspection import inspect  # noqa: E402

AXES = "xyz"

# the generator of the tests by its path: this folder has a module of the same name
_SPEC = importlib.util.spec_from_file_location("hand_held", ROOT / "tests" / "recordings.py")
recordings: Any = importlib.util.module_from_spec(cast("ModuleSpec", _SPEC))
sys.modules["hand_held"] = recordings
cast("ModuleSpec", _SPEC).loader.exec_module(recordings)  # pyright: ignore[reportOptionalMemberAccess]

KINDS = ("frozen", "dead", "torn", "sound")
NAMES = {"frozen": "stuck_output", "dead": "stuck_output", "torn": "torn_words"}


def drawn(rng: np.random.Generator, *, whole: bool) -> Any:
    """A recording in LSB as whole numbers, or (``whole`` false) as decimals of g with six digits."""
    per_g = float(rng.choice([256.0, 1000.0, 4096.0, 16384.0, 131072.0]))
    one = recordings.counts(
        rng,
        rate=float(rng.choice([50.0, 100.0, 200.0, 400.0])),
        positions=int(rng.integers(8, 25)),
        per_g=per_g,
        noise=float(rng.uniform(0.4, 8.0)),
    )
    return one if whole else recordings.Recording(**{**vars(one), "output": one.output / per_g})


def spoilt(kind: str, rng: np.random.Generator) -> tuple[Any, int, tuple[int, int]]:
    """A recording with one fault; its axis, and its rows where it has any."""
    one = drawn(rng, whole=bool(rng.random() < 0.7))
    output, axis, rows = one.output.copy(), int(rng.integers(3)), (0, len(one.output))
    if kind == "frozen":
        start, stop = one.spans[int(rng.integers(len(one.spans)))]
        start += int(rng.integers(0, (stop - start) // 2 + 1))
        output[start:stop, axis] = output[start, axis]
        rows = (start, stop)
    elif kind == "dead":
        output[:, axis] = output[0, axis]
    elif kind == "torn":
        step = 1.0 if np.all(output == np.rint(output)) else 1.0 / one.per_g
        power = 256.0 if one.noise * 8.0 < 256.0 else 512.0
        wrong = rng.random(len(output)) < rng.uniform(0.06, 0.11)
        output[wrong, axis] += step * power * rng.choice([-1.0, 1.0], size=int(wrong.sum()))
    return recordings.Recording(**{**vars(one), "output": output}), axis, rows


def told(kind: str, seed: tuple[int, ...], folder: Path) -> tuple[bool, str]:
    """Whether inspection tells the fault rightly (for ``sound``: tells nothing), and what it tells."""
    one, axis, (start, stop) = spoilt(kind, np.random.default_rng(seed))
    path = folder / "recording.csv"
    path.write_text(recordings.table(one).to_csv(index=False, float_format="%.7g"), encoding="utf-8")
    faults = inspect([path]).document["faults"]
    reported = {(f["fault"], f["axis"]) for f in faults}
    if kind == "sound":
        return not faults, str(reported)
    right = reported == {(NAMES[kind], AXES[axis])}
    if kind == "frozen":
        right = right and any(f["first_row"] <= start + 6 and f["first_row"] + f["samples"] >= stop - 5 for f in faults)
    return right, str(reported)


def interval(hits: int, runs: int) -> str:
    """Share with its 95 % interval (Clopper and Pearson), %."""
    low = beta.ppf(0.025, hits, runs - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, runs - hits) if hits < runs else 1.0
    return f"{hits} of {runs} [{100 * low:.1f}, {100 * high:.1f} %]"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=300, help="files of each kind")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for place, kind in enumerate(KINDS):
            results = [told(kind, (options.seed, place, number), Path(folder)) for number in range(options.runs)]
            hits = sum(right for right, _ in results)
            sys.stdout.write(f"{kind:8} told rightly: {interval(hits, options.runs)}\n")
            for number, (right, text) in enumerate(results):
                if not right:
                    sys.stdout.write(f"         seed {options.seed}, {kind} {number}: told {text}\n")
            sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
