"""Rates of wrong statements about noise, with noise of an independent generator: `python benchmarks/noise_verdicts.py terms`.

Each scene prints counts with exact 95 % intervals (Clopper and Pearson). The generator (`tests/independent_noise.py`) shares no
code with the estimators.
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
from inertial.population.change_points import change_points  # noqa: E402
from inertial.population.control_charts import alarms, baseline, chance_of_alarms, signals  # noqa: E402
from pipelines.stages.fit import fit  # noqa: E402
from pipelines.stages.noise import noise, static_record  # noqa: E402
from pipelines.stages.verify import verify  # noqa: E402

RATE, SAMPLES = 10.0, 36_000


def terms(records: int, seed: int) -> None:
    """White noise and random walk: false ramps, and coverage of the limits and intervals of N, B, K, R."""
    rng = np.random.default_rng(seed)
    density = 100.0
    for walk, flicker in ((0.3, 0.0), (1.0, 0.0), (3.0, 0.0), (10.0, 0.0), (0.0, 0.0), (0.0, 30.0), (3.0, 30.0)):
        x = made.white(rng, records, SAMPLES, density, RATE) + made.walk(rng, records, SAMPLES, walk, RATE)
        if flicker:
            x = x + made.flicker(rng, records, SAMPLES, flicker)
        fitted = fit_terms(overlapping(x, RATE))
        truth = {"Q": 0.0, "N": density / np.sqrt(2.0), "B": flicker, "K": walk, "R": 0.0}
        print(f"white {density:g} µg/√Hz, K {walk:g} µg/√s, B {flicker:g} µg, one hour at {RATE:g} Hz")
        for symbol, true in truth.items():
            place = fitted.symbols.index(symbol)
            value, low, high = (part[:, place] for part in (fitted.value, fitted.low, fitted.high))
            known = np.isfinite(value)
            zero = int(np.sum(known & (low <= 0.0)))
            print(
                made.told(f"  {symbol} identified", int(known.sum()), records)
                + f"   of these {zero} with an interval from 0"
            )
            if known.any():
                held = known & (low <= true) & (true <= high)
                print(made.told(f"  {symbol} interval contains the truth", int(held.sum()), int(known.sum())))
            if not known.all():
                held = ~known & (true <= high)
                print(made.told(f"  {symbol} upper limit is above the truth", int(held.sum()), int((~known).sum())))


CHECKS = ((35.0, 15.0), (125.0, -160.0), (70.0, 100.0), (160.0, 20.0), (100.0, -60.0), (20.0, -120.0))


def verification(records: int, seed: int) -> None:
    """The RMS error of the verification: its standard deviation between runs, and its stated uncertainty."""
    rng = np.random.default_rng(seed)
    for name, world in (
        ("B 30 µg", {"flicker": 30.0}),
        ("B 300 µg", {"flicker": 300.0}),
        ("B 30 µg, K 1 µg/√s", {"flicker": 30.0, "walk": 1.0}),
    ):
        shown, stated, plain = [], [], []
        for _ in range(records):
            dwells = lots.world(
                rng,
                units=4,
                plan="fibonacci",
                temperatures=(-10.0, 25.0, 60.0),
                checks=CHECKS,
                move_s=20,
                day_s=0,
                **world,
            ).dwells
            fitted = fit(
                dwells, lots.NO_HISTORY, ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]
            )
            tables = (fitted[name] for name in ("coefficients", "covariance", "predictions"))
            rows = verify(dwells, lots.NO_HISTORY, *tables)["verification"]
            for _, own in rows.groupby("unit"):
                for axis in "xyz":
                    rms = float(np.sqrt(np.mean(own[f"error_{axis}_ug"] ** 2)))
                    shown.append(rms)
                    plain.append(rms / np.sqrt(2.0 * len(own)))
                    stated.append(float(own.get(f"rms_uncertainty_{axis}_ug", pd.Series([np.nan])).iloc[0]))
        centre, real = float(np.mean(shown)), float(np.std(shown))
        print(
            f"{name}: rms error {centre:.1f} µg, between runs {real:.1f}; "
            f"stated: rms/√(2n) {np.median(plain):.1f}, covariance {np.median(stated):.1f}"
        )
        for what, u in (("rms/√(2n)", plain), ("the verification's covariance", stated)):
            held = int(np.sum(np.abs(np.array(shown) - centre) <= 2.0 * np.array(u)))
            print(made.told(f"  U (k = 2) by {what} contains the mean over runs", held, len(shown)))


def bias(records: int, seed: int) -> None:
    """Six faces at one temperature, and three rounds of 24 poses: coverage of the stated uncertainties of the bias."""
    rounds = {"plan": "fibonacci", "temperatures": (25.0, 25.0, 25.0), "move_s": 20}
    rng = np.random.default_rng(seed)
    for name, world in (
        ("six faces, ADXL355: 25 µg/√Hz, B 300 µg", {"flicker": 300.0}),
        ("six faces, 25 µg/√Hz, B 30 µg", {"flicker": 30.0}),
        ("six faces, 280 µg/√Hz, B 30 µg", {"flicker": 30.0, "density": 280.0}),
        ("six faces, 25 µg/√Hz, B 30 µg, K 1 µg/√s", {"flicker": 30.0, "walk": 1.0}),
        ("six faces, 25 µg/√Hz, B 30 µg, K 4 µg/√s", {"flicker": 30.0, "walk": 4.0}),
        ("24 poses, three rounds, 25 µg/√Hz, B 30 µg", {"flicker": 30.0, **rounds}),
        ("24 poses, three rounds, 25 µg/√Hz, B 30 µg, K 1 µg/√s", {"flicker": 30.0, "walk": 1.0, **rounds}),
        ("24 poses, three rounds, 25 µg/√Hz, B 30 µg, K 4 µg/√s", {"flicker": 30.0, "walk": 4.0, **rounds}),
    ):
        sums: dict[str, int] = {}
        total, ratio, day = 0, [], []
        for _ in range(records):
            one = lots.world(rng, units=4, **world)
            fitted = fit(one.dwells, lots.NO_HISTORY, ["bias", "scale", "misalignment"])
            rows = fitted["coefficients"]
            rows = rows[rows["effect"] == "bias"].sort_values(["unit", "axis"])
            value = 1e6 * rows["value"].to_numpy().reshape(-1, 3)
            stated = {"standard error": 1e6 * rows["standard_error"].to_numpy().reshape(-1, 3)}
            own = fitted["wander"].sort_values(["unit", "axis"])
            stated |= {n: own[n].to_numpy().reshape(-1, 3) for n in ("bias_record_u_ug", "bias_long_u_ug") if n in own}
            for what, u in stated.items():
                for whom, truth in (("the record's mean", one.record), ("the day's mean", one.day)):
                    key = f"  2·{what} contains {whom}"
                    sums[key] = sums.get(key, 0) + int(np.sum(np.abs(value - truth) <= 2.0 * u))
            total += value.size
            ratio.append(np.mean(stated["standard error"]))
            day.append(np.mean(stated["bias_long_u_ug"]))
        print(
            f"4 units, one temperature, {name}; u of the record {np.mean(ratio):.1f}, of the day {np.mean(day):.1f} µg"
        )
        for key, held in sums.items():
            print(made.told(key, held, total))


def series(records: int, seed: int) -> None:
    """Series with a constant level: false change points and alarms of control charts; and series with a step.

    Of the changes found at p ≤ 0.01, those below 0.001 and 0.0001 are counted.
    """
    rng = np.random.default_rng(seed)
    kinds = (
        ("white", 0.0, None),
        ("ρ = 0.6", 0.6, None),
        ("Student's t, 3 dof", 0.0, 3.0),
        ("ρ = 0.6, t 3 dof", 0.6, 3.0),
    )
    for n in (20, 40, 100):
        for name, memory, dof in kinds:
            made_ = made.autoregressive(rng, records, n, memory, dof=dof)
            p = np.array([min((c.p_value for c in change_points(v, 1e-2)), default=1.0) for v in made_])
            for level in (1e-2, 1e-3, 1e-4):
                print(made.told(f"{n} points, {name}: a change at p < {level:g}", int(np.sum(p < level)), records))
            for step in (2.0, 4.0):
                moved = made_ + step * (np.arange(n) >= n // 2)
                hits = sum(any(abs(c.first - n // 2) <= 3 for c in change_points(v)) for v in moved)
                print(made.told(f"    a step of {step:g} σ half-way is found", hits, records))
    for first, n in ((10, 20), (20, 40), (40, 100)):
        for name, memory, dof in kinds:
            made_ = made.autoregressive(rng, records, n, memory, dof=dof)
            title = f"control chart, {first} + {n - first} points, {name}"
            p = np.array([p_of_alarms(v, first) for v in made_])
            for level in (0.01, 0.001):
                print(made.told(f"{title}: out of control at p < {level:g}", int(np.sum(p < level)), records))
            hits = sum(p_of_alarms(v + 2.0 * (np.arange(n) >= first), first) < 0.01 for v in made_)
            print(made.told("    a change of 2 σ after the baseline is found", hits, records))


def p_of_alarms(values: np.ndarray, first: int) -> float:
    """Probability of the alarms of a chart by chance, as in the audit."""
    rules, moving = signals(values, baseline(values, first))
    number = alarms(rules, moving.outside, np.arange(values.size) >= first)
    return chance_of_alarms(values, first, values.size - first).p_value(number)


def record(records: int, seed: int) -> None:
    """Static records in a room with drift, and with coarse resolution: results from the samples alone, and of the stage."""
    rng = np.random.default_rng(seed)
    dwells = lots.world(rng, units=1, temperatures=(0.0, 25.0, 50.0), flicker=0.0, density=1.0, day_s=0).dwells
    for axis in "xyz":
        dwells[f"out_{axis}"] += 50e-6 * (dwells["unit_C"] - 25.0)
    fitted = fit(dwells, lots.NO_HISTORY, ["bias", "scale", "misalignment", "bias_temperature"])
    tables = fitted["coefficients"], fitted["covariance"]
    n, seconds = SAMPLES, SAMPLES / RATE
    for room_k in (0.1, 0.3):
        slow = {"samples alone": 0, "temperature coefficient removed": 0}
        for _ in range(records):
            history, course = lots.room(rng, 1, seconds, room_k)
            drift = 50.0 * np.interp(np.arange(n) / RATE, np.arange(0.0, seconds + 1.0, 10.0), course - 25.0)
            values = made.white(rng, 3, n, 25.0, RATE).T + drift[:, None]
            samples, readings = lots.static_record(1e-6 * values[None], RATE)
            for name, past in (("samples alone", None), ("temperature coefficient removed", history)):
                rows = noise(static_record([samples], readings, *tables, past))["noise"]
                slow[name] += int(rows[rows["term"].isin(["B", "K", "R"])].groupby("axis")["identified"].any().sum())
        for name, count in slow.items():
            print(
                made.told(f"room of {room_k:g} K, 50 µg/K, 25 µg/√Hz, {name}: B, K or R identified", count, 3 * records)
            )
    for step in (1.0, 1.8, 3.0, 5.0):
        lsb, plain, stated, held, limits = step * 25.0 * np.sqrt(RATE / 2.0), [], [], 0, 0
        for _ in range(records):
            values = made.white(rng, 3, n, 25.0, RATE).T + rng.uniform(0.0, lsb, 3)
            samples, readings = lots.static_record(1e-6 * lsb * np.round(values / lsb)[None], RATE)
            rows = noise(static_record([samples], readings, *tables))["noise"]
            rows = rows[rows["term"] == "n_d"]
            plain += [float(np.sqrt(np.mean(np.diff(lsb * np.round(v / lsb)) ** 2) / RATE)) / 25.0 for v in values.T]
            stated += (rows["value"].dropna() / 25.0).tolist()
            held += int(((rows["low"] <= 25.0) & (rows["high"] >= 25.0)).sum())
            limits += int((rows["value"].isna() & rows["high"].notna()).sum())
        low, middle, high = np.quantile(plain, (0.05, 0.5, 0.95))
        print(f"resolution of {step:g} σ: n_d of the samples {low:.2f} … {middle:.2f} … {high:.2f} of the truth; stated "
              + (f"{np.mean(stated):.3f} ± {np.std(stated):.3f}" if stated else "no value") + f", {limits} limits")  # fmt: skip
        print(made.told("    interval or limit contains the truth", held, 3 * records))


SCENES = {
    "record": record,
    "series": series,
    "terms": terms,
    "verification": verification,
    "bias": bias,
}


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
