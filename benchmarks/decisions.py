"""What each number that decides the search of a diagnosis does: `python benchmarks/decisions.py --runs 5`.

Every number of `inertial/decisions.py` that is listed here is set to half, to its value, and to twice as much, and the
worlds that it matters in are diagnosed. Printed are the runs whose verdict is right, with 95 % Clopper-Pearson intervals: nothing
named and adequate where nothing is hidden, the truth in its class and nothing beside it otherwise; a driver called unexplained
where the physics is in no catalogue. Seeds of their own, apart from those of `benchmarks/worlds --seeds judging`.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "worlds"), str(HERE.parent)]


import physics  # noqa: E402
from scipy import stats  # noqa: E402
from tables import FAULTS, HIDDEN, NULLS  # noqa: E402
from world import World, make  # noqa: E402

SEED = 63_000_000


def _bump(rng: Any, units: int, scene: Any) -> Any:
    """A bias that rises in a band of temperature of 8 K: physics of no catalogue."""
    centre, size = float(rng.uniform(-5.0, 5.0)), rng.standard_normal((1, 3)) + 0.3 * rng.standard_normal((units, 3))
    import numpy as np

    return lambda s: size[:, None] * np.exp(-0.5 * ((s.temperature - 20.0 - centre) / 4.0) ** 2)[..., None]


physics.PHYSICS["band"] = _bump
STAIRS = tuple(float(t) for t in range(-10, 61, 7))
AROUND = (25.0, 60.0, 40.0, 10.0, -10.0, 10.0, 30.0)
WORLDS: dict[str, World] = {
    "null": NULLS["B30"],
    "null_K4": NULLS["K4"],
    "null_t3": NULLS["t3"],
    "aging_linear_1": HIDDEN["aging_linear_1"],
    "bias_temperature_quadratic_2": HIDDEN["bias_temperature_quadratic_2"],
    "warm_up_1": HIDDEN["warm_up_1"],
    "third_order_2": HIDDEN["third_order_2"],
    "two_effects": World(hidden=(("third_order", 1.5), ("aging_linear", 1.5))),
    "band": World(hidden=(("band", 2.0),), poses=8, soaks=STAIRS),
    "band_and_cubic": World(hidden=(("band", 2.0), ("third_order", 1.5)), poses=8, soaks=STAIRS),
    "converter": NULLS["lsb5"],
    "converter_fine": replace(NULLS["lsb5"], lsb=0.5),
    "dwell": FAULTS["dwell_0.5mg"],
    "null_t3_one_unit": NULLS["t3_one_unit"],
    "dwell_one_unit": FAULTS["dwell_one_unit"],
    "hysteresis_20": World(hidden=(("thermal_hysteresis", 20.0),), poses=8, soaks=AROUND),
    "kink_20": World(hidden=(("thermal_kink", 20.0),), poses=8, soaks=STAIRS),
    "warm_up_20": World(hidden=(("warm_up", 20.0),)),
    "cubic_10_and_moved": World(hidden=(("third_order", 10.0),), fault="unit_moved", amount=0.2),
    "cubic_10_and_pose": World(hidden=(("third_order", 10.0),), fault="wrong_pose", amount=0.02),
}
MATTERS: dict[str, tuple[str, ...]] = {
    "LESS_WALK": ("aging_linear_1", "null_K4"),
    "LESS_FLICKER": ("aging_linear_1", "null"),
    "RIVAL_NEAR": ("bias_temperature_quadratic_2", "warm_up_1"),
    "AXES_DIFFER": ("warm_up_1", "null"),
    "UNITS_TOGETHER": ("third_order_2",),
    "UNEXPLAINED": ("band", "null_K4"),
    "MATERIAL": ("null_K4", "aging_linear_1", "converter_fine"),
    "CURVE_AHEAD": ("third_order_2", "two_effects", "band", "band_and_cubic"),
    "CURVE_SHARE": ("third_order_2", "two_effects", "warm_up_1", "band"),
    "FOLD_BLIND": ("bias_temperature_quadratic_2",),
    "STEPS_UNEVEN": ("converter", "converter_fine", "null"),
    "STEPS_FOLLOW": ("converter", "converter_fine", "null"),
    "HEAVY": ("null_t3", "dwell"),
    "TAILS": ("null_t3_one_unit", "dwell_one_unit"),
    "TAILS_REACH": ("null_t3_one_unit", "dwell_one_unit"),
    "REMAINDER": ("hysteresis_20", "kink_20", "warm_up_20", "cubic_10_and_moved", "cubic_10_and_pose"),
}


@contextmanager
def changed(name: str, factor: float) -> Generator[None, None, None]:
    """A number of the decisions at another value, wherever it was imported to."""
    import inertial.criticism.diagnosis  # noqa: F401  # everything that imports one
    from inertial import decisions

    value = getattr(decisions, name)
    other = {k: v * factor for k, v in value.items()} if isinstance(value, dict) else value * factor
    rooms = ("inertial.criticism", "inertial.estimation")
    held = [m for k, m in sys.modules.items() if k.startswith(rooms) and getattr(m, name, None) is value]
    for module in held:
        setattr(module, name, other)
    try:
        yield
    finally:
        for module in held:
            setattr(module, name, value)


def right(world: World, document: dict[str, Any], made: Any) -> bool:
    """Whether a verdict is the truth."""
    named = [group["effects"] for group in document["classes"]]
    if world.lsb > 1.0:
        return bool(document["blocked_by"]) and all(f["fault"] == "quantised" for f in document["blocked_by"])
    if document["blocked_by"]:
        return False
    own = [name for name, _ in world.hidden]
    if made.faults:
        every = {n for g in named for n in g}
        told = all(set(t.names) & every for t in made.faults) and set(own) <= every
        return told and len(named) == len(made.faults) + len(own)
    known = [name for name in own if name != "band"]
    if "band" in own and document["unexplained"] is None:
        return False
    if not own:
        return not named and document["adequate"] is True
    return len(named) == len(known) and all(any(name in group for group in named) for name in known)


def main() -> None:
    """Print a line for every number and world."""
    from pipelines.diagnosis.diagnose import diagnose

    parser = argparse.ArgumentParser(prog="python benchmarks/decisions.py", description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", action="append", default=[])
    options = parser.parse_args()
    known: dict[tuple[str, int], bool] = {}
    for name, worlds in MATTERS.items():
        if options.only and name not in options.only:
            continue
        for world in worlds:
            cells = []
            for factor in (0.5, 1.0, 2.0):
                hits = 0
                for seed in range(SEED + options.first, SEED + options.first + options.runs):
                    key = (world, seed)
                    if factor == 1.0 and key in known:
                        hits += known[key]
                        continue
                    made = make(WORLDS[world], seed)
                    with changed(name, factor):
                        good = right(WORLDS[world], diagnose(made.dwells, made.history), made)
                    hits += good
                    if factor == 1.0:
                        known[key] = good
                limits = stats.binomtest(hits, options.runs).proportion_ci(0.95, "exact")
                cells.append(f"×{factor:g}: {hits}/{options.runs} [{limits.low:.2f}, {limits.high:.2f}]")
            print(f"{name:16s} {world:30s} right {'  '.join(cells)}", flush=True)


if __name__ == "__main__":
    main()
