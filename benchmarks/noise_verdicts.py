"""How often what is said of noise is wrong, on noise made by an independent generator: `python benchmarks/noise_verdicts.py terms`.

Each scene prints counts with exact 95 % intervals (Clopper and Pearson). The generator (`tests/independent_noise.py`) shares no code
with the estimators; the seeds are the ones below and served no choice of a constant.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

import independent_noise as made  # noqa: E402
import numpy as np  # noqa: E402

from inertial.noise.allan import overlapping  # noqa: E402
from inertial.noise.terms import fit_terms  # noqa: E402

RATE, SAMPLES = 10.0, 36_000


def terms(records: int, seed: int) -> None:
    """White noise and a walk: the ramp that is not there, and whether the limits and intervals of N, B, K, R hold the truth."""
    rng = np.random.default_rng(seed)
    density = 100.0
    for walk, flicker in ((0.3, 0.0), (1.0, 0.0), (3.0, 0.0), (10.0, 0.0), (0.0, 0.0), (0.0, 30.0), (3.0, 30.0)):
        x = made.white(rng, records, SAMPLES, density, RATE) + made.walk(rng, records, SAMPLES, walk, RATE)
        if flicker:
            x = x + made.flicker(rng, records, SAMPLES, flicker)
        found = fit_terms(overlapping(x, RATE))
        truth = {"Q": 0.0, "N": density / np.sqrt(2.0), "B": flicker, "K": walk, "R": 0.0}
        print(f"white {density:g} µg/√Hz, K {walk:g} µg/√s, B {flicker:g} µg, one hour at {RATE:g} Hz")
        for symbol, true in truth.items():
            place = found.symbols.index(symbol)
            value, low, high = (part[:, place] for part in (found.value, found.low, found.high))
            known = np.isfinite(value)
            zero = int(np.sum(known & (low <= 0.0)))
            print(made.told(f"  {symbol} identified", int(known.sum()), records) + f"   of these {zero} with an interval from 0")
            if known.any():
                held = known & (low <= true) & (true <= high)
                print(made.told(f"  {symbol} interval holds the truth", int(held.sum()), int(known.sum())))
            if not known.all():
                held = ~known & (true <= high)
                print(made.told(f"  {symbol} upper limit holds the truth", int(held.sum()), int((~known).sum())))


SCENES = {"terms": terms}


def main() -> None:
    """Runs one scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", choices=sorted(SCENES))
    parser.add_argument("--records", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1_300_501)
    given = parser.parse_args()
    SCENES[given.scene](given.records, given.seed)


if __name__ == "__main__":
    main()
