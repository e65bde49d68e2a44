"""Contradiction of references: false alarms and power: `python benchmarks/contradiction.py --lots 40`.

Lots of eight are measured on a station that draws its errors as stated, or larger: the whole table, or one contribution. Told
is what the product's own judgement of the fit's tables finds. The station is the simulated plant's geometry; it does not know
the judgement. Intervals are 95 % (Clopper and Pearson).
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import pandas as pd
from scipy.stats import beta

from benchmarks.budget import PRESETS, STATED
from benchmarks.budget_lots import DRAWN, DWELL_S, RECIPES, Plan, measured, plan_of
from pipelines.stages.fit import fit
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms
from pipelines.stages.uncertainty.contradiction import LotReferences, lot_references
from schemas.simulation import ReferenceErrors
from schemas.validity import CertificateTerms, Stability
from stations.plant.preset import Preset, load_preset

TABLE = ("level", "orthogonality", "outer_offset", "inner_offset", "harmonics", "pose")
CERTIFIED_FROM = 0.001


def larger(factor: float, names: tuple[str, ...] = TABLE) -> ReferenceErrors:
    """The station's errors, those of some contributions larger by a factor."""
    return DRAWN.model_copy(update={f"{name}_urad": factor * getattr(DRAWN, f"{name}_urad") for name in names})


def judged(plan: Plan, preset: Preset, drawn: ReferenceErrors, rng: np.random.Generator) -> LotReferences:
    """The judgement of one lot on a station with errors of these sizes."""
    dwells, _, _ = measured(plan, preset, rng, drawn)
    history = pd.DataFrame({"time_s": [], "chamber_C": [], "slot": [], "unit": [], "unit_C": []})
    fitted = fit(dwells, history, plan.effects)
    stability = Stability(horizon_days=3660.0, source="history", bias_temperature_ug_K=preset.bias_tempco_ug_per_K,
                          scale_temperature_ppm_K=preset.scale_tempco_ppm_per_K, temperature_of="slot")  # fmt: skip
    terms = BudgetTerms(STATED, stability, CertificateTerms(frame="fixture"), (), 900.0, DWELL_S, 23.0)
    none = pd.DataFrame()
    tables = (fitted[name] for name in ("coefficients", "covariance", "wander"))
    judgement = lot_references(BudgetTables(dwells, history, *tables, none, none, none), terms)
    if isinstance(judgement, str):
        raise TypeError(judgement)
    return judgement


def interval(count: int, of: int) -> str:
    """A share with its interval."""
    low = beta.ppf(0.025, count, of - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, of - count) if count < of else 1.0
    return f"{count} of {of} [{100 * low:.1f}, {100 * high:.1f} %]"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lots", type=int, default=40, help="of each recipe, device and size")
    parser.add_argument("--seed", type=int, default=20262)
    parser.add_argument("--size", type=float, action="append")
    parser.add_argument(
        "--only", action="append", choices=TABLE, help="contribution that is larger; the whole table by default"
    )
    options = parser.parse_args()
    names = tuple(options.only or TABLE)
    for size in options.size or (1.0, 2.0, 4.0):
        whole: Counter[str] = Counter()
        for r, recipe in enumerate(RECIPES):
            for p, name in enumerate(PRESETS):
                rng = np.random.default_rng([options.seed, round(10 * size), r, p])
                lots = [
                    judged(plan_of(recipe), load_preset(name), larger(size, names), rng) for _ in range(options.lots)
                ]
                own = Counter(one.name for lot in lots for one in lot.found)
                first = Counter(lot.found[0].name for lot in lots if lot.found)
                told = Counter({"told": sum(bool(lot.found) for lot in lots),
                                "refused": sum(lot.p_value < CERTIFIED_FROM for lot in lots),
                                "along": sum(lot.along_p < 0.01 for lot in lots), "lots": len(lots)})  # fmt: skip
                whole += told
                print(f"× {size:g}  {recipe:18} {name:8} told {told['told']} of {len(lots)}, along the force {told['along']}; "
                      f"found {dict(own)}, first {dict(first)}", flush=True)  # fmt: skip
        for key in ("told", "refused", "along"):
            print(f"× {size:g}  all: {key} {interval(whole[key], whole['lots'])}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
