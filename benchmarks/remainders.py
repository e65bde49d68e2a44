"""What effects leave over that handling would explain, and real handling beside effects: `python benchmarks/remainders.py`.

Sets `REMAINDER` of `inertial/decisions.py`. Printed is, for every alternative of handling that is convincing beside an
effect found before, its size over the largest effect, and whether such a fault was made. Seeds of their own.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "worlds"), str(HERE.parent)]

from world import World, make  # noqa: E402

SEED = 64_000_000
STAIRS = tuple(float(t) for t in range(-10, 61, 10))
AROUND = (25.0, 60.0, 40.0, 10.0, -10.0, 10.0, 30.0)
SMALL = World(units=4, poses=16)
WORLDS: dict[str, World] = {
    "hysteresis": replace(SMALL, hidden=(("thermal_hysteresis", 20.0),), poses=8, soaks=AROUND),
    "kink": replace(SMALL, hidden=(("thermal_kink", 20.0),), poses=8, soaks=STAIRS),
    "warm-up": replace(SMALL, hidden=(("warm_up", 20.0),)),
    "converter": replace(SMALL, hidden=(("adc_nonlinearity", 20.0),)),
    "level": replace(SMALL, hidden=(("level_error", 20.0),)),
    "misalignment over T": replace(SMALL, hidden=(("misalignment_temperature", 20.0),)),
    "cubic": replace(SMALL, hidden=(("third_order", 40.0),)),
    "cubic and a moved unit": replace(SMALL, hidden=(("third_order", 10.0),), fault="unit_moved", amount=0.2),
    "cubic and a pose": replace(SMALL, hidden=(("third_order", 10.0),), fault="wrong_pose", amount=0.05),
    "square over T and a slip": replace(
        SMALL, hidden=(("bias_temperature_quadratic", 10.0),), fault="table_slip", amount=0.2
    ),
}


def beside(world: World, seed: int) -> list[tuple[str, float, bool]]:
    """Alternatives found beside effects: name, size over that of the largest effect, whether such a fault was made."""
    from inertial.criticism import search
    from inertial.estimation.alternative import Handling
    from pipelines.diagnosis.diagnose import diagnose

    made, alternatives = make(world, seed), []
    own = {name for told in made.faults for name in told.names}
    plain = search.is_remainder

    def noted(model: Any, rival: Any, chosen: Any) -> bool:
        if chosen and isinstance(rival.term.effect, Handling):
            largest = max(search.size_of(model.without_term(t), t) for t in chosen)
            ratio = search.size_where_it_acts(model, rival.term) / largest
            alternatives.append((rival.term.effect.id, ratio, rival.term.effect.id in own))
        return plain(model, rival, chosen)

    search.is_remainder = noted
    try:
        diagnose(made.dwells, made.history)
    finally:
        search.is_remainder = plain
    return alternatives


def main() -> None:
    """Print a line for every world."""
    parser = argparse.ArgumentParser(prog="python benchmarks/remainders.py", description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    for name, world in WORLDS.items():
        rows = [row for k in range(options.runs) for row in beside(world, SEED + options.first + k)]
        for real in (True, False):
            ratios = ", ".join(f"{what} {ratio:.3f}" for what, ratio, true in rows if true is real)
            if ratios:
                print(f"{name:26s} {'made' if real else 'left over'}: {ratios}", flush=True)
        print(f"{name:26s} {options.runs} runs", flush=True)


if __name__ == "__main__":
    main()
