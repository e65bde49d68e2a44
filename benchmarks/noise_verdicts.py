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

import independent_lots as lots  # noqa: E402
import independent_noise as made  # noqa: E402
import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402

from inertial.noise.allan import overlapping  # noqa: E402
from inertial.noise.terms import fit_terms  # noqa: E402
from pipelines.stages.fit import fit  # noqa: E402
from pipelines.stages.verify import verify  # noqa: E402

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


CHECKS = ((35.0, 15.0), (125.0, -160.0), (70.0, 100.0), (160.0, 20.0), (100.0, -60.0), (20.0, -120.0))


def verification(records: int, seed: int) -> None:
    """The RMS error of the verification: its standard deviation between runs, and what is told of it."""
    rng = np.random.default_rng(seed)
    for name, noise in (("B 30 µg", {"flicker": 30.0}), ("B 300 µg", {"flicker": 300.0}), ("B 30 µg, K 1 µg/√s", {"flicker": 30.0, "walk": 1.0})):
        shown, told, plain = [], [], []
        for _ in range(records):
            dwells = lots.world(
                rng, units=4, plan="fibonacci", temperatures=(-10.0, 25.0, 60.0), checks=CHECKS, move_s=20, day_s=0, **noise
            ).dwells
            found = fit(dwells, lots.NO_HISTORY, ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"])
            tables = (found[name] for name in ("coefficients", "covariance", "predictions"))
            rows = verify(dwells, lots.NO_HISTORY, *tables)["verification"]
            for _, own in rows.groupby("unit"):
                for axis in "xyz":
                    rms = float(np.sqrt(np.mean(own[f"error_{axis}_ug"] ** 2)))
                    shown.append(rms)
                    plain.append(rms / np.sqrt(2.0 * len(own)))
                    told.append(float(own.get(f"rms_uncertainty_{axis}_ug", pd.Series([np.nan])).iloc[0]))
        centre, real = float(np.mean(shown)), float(np.std(shown))
        print(f"{name}: rms error {centre:.1f} µg, between runs {real:.1f}; told rms/√(2n) {np.median(plain):.1f}, covariance {np.median(told):.1f}")
        for what, u in (("rms/√(2n)", plain), ("the verification's covariance", told)):
            held = int(np.sum(np.abs(np.array(shown) - centre) <= 2.0 * np.array(u)))
            print(made.told(f"  U (k = 2) by {what} holds the mean over runs", held, len(shown)))


def bias(records: int, seed: int) -> None:
    """Six faces at one temperature: what the stated uncertainties of the bias hold."""
    rng = np.random.default_rng(seed)
    for name, noise in (
        ("ADXL355: 25 µg/√Hz, B 300 µg", {"flicker": 300.0}),
        ("25 µg/√Hz, B 30 µg", {"flicker": 30.0}),
        ("280 µg/√Hz, B 30 µg", {"flicker": 30.0, "density": 280.0}),
    ):
        sums: dict[str, int] = {}
        total, ratio = 0, []
        for _ in range(records):
            world = lots.world(rng, units=4, **noise)
            found = fit(world.dwells, lots.NO_HISTORY, ["bias", "scale", "misalignment"])
            rows = found["coefficients"]
            rows = rows[rows["effect"] == "bias"].sort_values(["unit", "axis"])
            value = 1e6 * rows["value"].to_numpy().reshape(-1, 3)
            stated = {"standard error": 1e6 * rows["standard_error"].to_numpy().reshape(-1, 3)}
            own = found["wander"].sort_values(["unit", "axis"])
            stated |= {n: own[n].to_numpy().reshape(-1, 3) for n in ("bias_record_u_ug", "bias_long_u_ug") if n in own}
            for what, u in stated.items():
                for whom, truth in (("the record's mean", world.record), ("the day's mean", world.day)):
                    key = f"  2·{what} holds {whom}"
                    sums[key] = sums.get(key, 0) + int(np.sum(np.abs(value - truth) <= 2.0 * u))
            total += value.size
            ratio.append(np.mean(stated["standard error"]))
        print(f"six faces, one temperature, 4 units, {name}; standard error {np.mean(ratio):.1f} µg")
        for key, held in sums.items():
            print(made.told(key, held, total))


SCENES = {"terms": terms, "verification": verification, "bias": bias}


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
