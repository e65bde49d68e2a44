"""Whether the error that a grade is based on is exceeded as seldom as stated: `python benchmarks/exceedance.py --units 504`.

Lots of a preset are calibrated on a station that draws its errors at random, and used once more a year later on exact references:
switched on anew, with flicker, random walk and white noise of their own. The noise is drawn step by step from its definition
(Ornstein–Uhlenbeck processes an octave apart up to the slowest time constant of the preset, a walk that begins at switching on)
and knows nothing of the budget. Reported are the share of units whose largest RMS error of an axis exceeds the stated 95 % bound,
and, at each limit of a grade, how many exceed it and how many the stated probabilities expect.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from scipy.stats import beta  # noqa: E402

from benchmarks.budget import PRESETS, STATED, columns, response_of  # noqa: E402
from benchmarks.budget_lots import (  # noqa: E402
    BASE,
    DWELL_S,
    LOT,
    RECIPES,
    Plan,
    measured,
    plan_of,
    true_coefficients,
)
from inertial.frames import force_from_angles  # noqa: E402
from pipelines.stages.fit import fit  # noqa: E402
from pipelines.stages.uncertainty.budget import budget  # noqa: E402
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms  # noqa: E402
from pipelines.stages.verify import verify  # noqa: E402
from schemas.decisions import BOUND, GRADES, LARGEST_ERROR, MEDIAN, exceedance  # noqa: E402
from schemas.validity import CertificateTerms, Stability  # noqa: E402
from stations.plant.preset import Preset, load_preset  # noqa: E402

Array = np.ndarray
NOTHING = {"unit": [], "axis": [], "term": [], "value": [], "high": [], "identified": []}


def stability_of(preset: Preset) -> Stability:
    """What the preset states beyond a run."""
    assert preset.stability is not None
    return preset.stability


def wander(preset: Preset, times: Array, rng: np.random.Generator) -> Array:
    """Flicker, walk and white noise of dwell means, (n, 3), g: in steps from one dwell to the next."""
    out = 1e-6 * preset.noise_density_ug / np.sqrt(2.0 * DWELL_S) * rng.standard_normal((times.size, 3))
    steps = np.diff(times, prepend=0.0)
    out += (
        1e-6 * preset.rate_random_walk_ug * np.cumsum(np.sqrt(steps)[:, None] * rng.standard_normal((times.size, 3)), 0)
    )
    constant, slowest = 2.0 * DWELL_S, stability_of(preset).flicker_slowest_s or 0.0
    while constant <= slowest:
        size = 1e-6 * preset.bias_instability_ug * np.sqrt(np.log(2.0) / np.pi)  # S(f) = B²/(πf)
        state = rng.standard_normal(3)
        for k, step in enumerate(steps):
            kept = np.exp(-step / constant)
            state = kept * state + np.sqrt(1.0 - kept**2) * rng.standard_normal(3)
            out[k] += size * state
        constant *= 2.0
    return out


@dataclass(frozen=True)
class Used:
    """Units as stated and as met: median and bound of the largest error, and the largest error met, µg."""

    median: Array
    bound: Array
    met: Array


def used_again(plan: Plan, preset: Preset, rng: np.random.Generator) -> Used:
    """One lot, calibrated and used a year later."""
    dwells, truths, _ = measured(plan, preset, rng, noise_of=lambda: wander(preset, plan.time, rng))
    history = pd.DataFrame({"time_s": [0.0], "chamber_C": [25.0], "slot": [0], "unit": ["U0"], "unit_C": [25.0]}).iloc[
        :0
    ]
    fitted = fit(dwells, history, plan.effects)
    checked = verify(dwells, history, fitted["coefficients"], fitted["covariance"], fitted["predictions"])
    terms = BudgetTerms(STATED, stability_of(preset).model_copy(update={"temperature_of": "slot"}),
                        CertificateTerms(frame="fixture"), (), 900.0, DWELL_S, 23.0)  # fmt: skip
    tables = BudgetTables(dwells, history, fitted["coefficients"], fitted["covariance"], fitted["wander"],
                          checked["verification"], checked["verification_poses"], pd.DataFrame(NOTHING))  # fmt: skip
    sums = budget(tables, terms)["uncertainties"]
    largest = sums[sums["quantity"] == LARGEST_ERROR].pivot_table(
        index="unit", columns="axis", values="value", sort=False
    )
    coefficients, width = fitted["coefficients"], 4 if plan.effects == BASE else 8
    met = []
    for unit, truth in enumerate(truths):
        own = coefficients[(coefficients["unit"] == f"U{unit}") & (coefficients["axis"] != "*")]["value"].to_numpy()
        met.append(_met(plan, own.reshape(3, width), true_coefficients(truth, plan.effects), preset, rng))
    order = [f"U{unit}" for unit in range(len(truths))]
    return Used(largest.loc[order, MEDIAN].to_numpy(), largest.loc[order, BOUND].to_numpy(), np.array(met))


def _met(plan: Plan, estimate: Array, true: Array, preset: Preset, rng: np.random.Generator) -> float:
    """Largest RMS error of an axis over the poses of the verification in a use a year later, µg."""
    force = force_from_angles(plan.outer, plan.inner)[plan.check]
    theta = np.array(plan.levels)[plan.soak][plan.check] - 25.0
    moved = np.stack([columns(force, theta, a, true.shape[1]) @ (estimate - true)[a] for a in range(3)], axis=1)
    later = wander(preset, plan.time, rng)[plan.check]
    later = later + 1e-6 * stability_of(preset).switch_on_ug * rng.standard_normal(3)
    later = later + 1e-6 * stability_of(preset).switch_on_ppm * rng.standard_normal(3) * force
    error = (later - moved) @ np.linalg.inv(response_of(estimate)).T
    return float(1e6 * np.sqrt(np.mean(error**2, axis=0)).max())


def interval(count: int, of: int) -> str:
    """Clopper and Pearson, 95 %."""
    low = 0.0 if count == 0 else beta.ppf(0.025, count, of - count + 1)
    high = 1.0 if count == of else beta.ppf(0.975, count + 1, of - count)
    return f"{100 * count / of:.1f} [{100 * low:.1f}, {100 * high:.1f}]"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=504)
    parser.add_argument("--seed", type=int, default=20264)
    parser.add_argument("--recipe", action="append", choices=list(RECIPES))
    parser.add_argument("--preset", action="append", choices=PRESETS)
    options = parser.parse_args()
    print("units beyond their 95 % bound, %; beyond the limit of a grade: met (stated)")
    print("{:18} {:8} {:>5} {:>18} {:>7} {:>7} ".format("recipe", "device", "units", "beyond", "bound", "met"), *GRADES)
    for recipe in options.recipe or ["24 directions × 3"]:
        for name in options.preset or PRESETS:
            start, plan, preset = time.perf_counter(), plan_of(recipe), load_preset(name)
            rng = np.random.default_rng([options.seed, list(RECIPES).index(recipe), PRESETS.index(name)])
            lots = [used_again(plan, preset, rng) for _ in range(-(-options.units // LOT))]
            median, bound, met = (
                np.concatenate([getattr(lot, part) for lot in lots]) for part in ("median", "bound", "met")
            )
            cells = []
            for limit in GRADES.values():
                stated = sum(exceedance(m, b, limit) for m, b in zip(median, bound, strict=True))
                cells.append(f"{int(np.sum(met > limit))} ({stated:.1f})")
            beyond = interval(int(np.sum(met > bound)), met.size)
            print(f"{recipe:18} {name:8} {met.size:5} {beyond:>18} {np.median(bound):7.0f} {np.median(met):7.0f} ",
                  *cells, f"{time.perf_counter() - start:.0f} s", flush=True)  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
