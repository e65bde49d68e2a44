"""How often each decision about the noise is right: `python benchmarks/decision_rates.py --runs 40`.

The decisions before any search for effects, each at its value in `inertial/decisions.py`, on lots of
`benchmarks/worlds` with seeds of their own: dwells left out and named, variances of units taken as different, tails of the
residuals taken as heavy, noise common to all units. Every rate with its 95 % Clopper-Pearson interval; `benchmarks/decisions.py`
varies the values of those that decide in the search.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "worlds"), str(HERE.parent)]

import numpy as np  # noqa: E402
from noise import Noise  # noqa: E402
from scipy import stats  # noqa: E402
from tables import NULLS  # noqa: E402
from world import World, make  # noqa: E402

SEED = 71_000_000
BASE = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
WHITE = Noise(white=100.0, flicker=0.0)
DWELLS = {
    f"dwell {size:g} sd, {units} units{' white' if noise is WHITE else ''}": World(
        units=units, noise=noise, fault="bad_dwell", floors=size
    )
    for units, noise in ((8, Noise()), (1, Noise()), (8, WHITE))
    for size in (5.0, 7.0, 8.0)
}
TAILED = {
    f"t3 {name}, {units} units": replace(World(units=units), noise=noise)
    for units in (8, 1)
    for name, noise in (
        ("white", Noise(white=100.0, flicker=0.0, tails=3)),
        ("beside 1/f", Noise(white=100.0, tails=3)),
    )
}
PLAIN = {name: NULLS[name] for name in ("B30", "K4", "one_unit", "units_spread", "axis_x1.5", "rest20")}
WORLDS: dict[str, World] = {**PLAIN, **TAILED, **DWELLS}


def decided(world: World, seed: int) -> dict[str, bool]:
    """The decisions about the noise of one lot."""
    from inertial.criticism.examination import ExaminedRun
    from inertial.data_errors.bad_dwells import bad_dwells
    from inertial.data_errors.tails import heavy, with_tails
    from inertial.estimation.likelihood import scatter_of_poses, shared_noise
    from pipelines.tables.condense import condense
    from pipelines.tables.dwells import lot_of, measured

    made = make(world, seed)
    run = ExaminedRun(lot_of(measured(condense(made.dwells), made.history), square=False), BASE)
    run.removed = bad_dwells(run.model())
    model = run.model()
    listed = with_tails(model, run.removed)
    spoilt = {(int(told.units[0][1:]) - 1, told.dwells[0]) for told in made.faults}
    gone, named = ({(d.unit, d.dwell) for d in listed if tail or not d.tail} for tail in (True, False))
    residual = model.space.residual[model.problem.covariance.there]
    return {
        "spoilt dwell left out": bool(spoilt) and spoilt <= gone,
        "spoilt dwell named": bool(spoilt) and spoilt <= named,
        "sound dwell left out": bool(gone - spoilt),
        "sound dwell named": bool(named - spoilt),
        "variances differ": bool(np.isfinite(model.noise.prior)),
        "tails heavy": heavy(residual),
        "noise common to all": max(shared_noise(model), scatter_of_poses(model)) > 1.0,
    }


def main() -> None:
    """Print a line for every world."""
    parser = argparse.ArgumentParser(prog="python benchmarks/decision_rates.py", description=__doc__)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--world", action="append", default=[])
    options = parser.parse_args()
    for place, (name, world) in enumerate(WORLDS.items()):
        if options.world and name not in options.world:
            continue
        first = SEED + 10_000 * place + options.first
        rows = [decided(world, seed) for seed in range(first, first + options.runs)]
        cells = []
        for key in rows[0]:
            hits = sum(row[key] for row in rows)
            if key.startswith("spoilt") and not world.fault:
                continue
            low, high = stats.binomtest(hits, len(rows)).proportion_ci(0.95, "exact")
            cells.append(f"{key} {hits}/{len(rows)} [{low:.2f}, {high:.2f}]")
        print(f"{name:30s} {' · '.join(cells)}", flush=True)


if __name__ == "__main__":
    main()
