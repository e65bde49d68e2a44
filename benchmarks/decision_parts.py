"""Decisions inside a diagnosis at half, at their value and at twice as much, without the rest of the diagnosis.

`python benchmarks/characteristics.py --only STEPS_UNEVEN` and the other names of `PARTS`. Each gives for every world and value
the number of lots, or of looks, in which the decision is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from decisions import changed
from scipy import stats
from tables import HIDDEN, NULLS
from world import World, make

if TYPE_CHECKING:
    from inertial.criticism.examination import ExaminedRun
    from inertial.data_errors.readings import Readings

Counts = tuple[int, int]
"""Decisions taken, of so many."""

Part = tuple["Callable[[World, int], Counts]", "dict[str, World]"]
"""A decision, and the worlds that it matters in."""

SEED = 66_500_000
BASE = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
FACTORS = (0.5, 1.0, 2.0)


@lru_cache(maxsize=32)
def rate(hits: int, runs: int) -> str:
    """A rate with its Clopper-Pearson interval."""
    limits = stats.binomtest(hits, runs).proportion_ci(0.95, "exact")
    return f"{hits} of {runs} [{limits.low:.2g}, {limits.high:.2g}]"


def run_of(world: World, seed: int) -> ExaminedRun:
    """A lot with its model, bad dwells left out."""
    from inertial.criticism.examination import ExaminedRun
    from inertial.data_errors.bad_dwells import bad_dwells
    from pipelines.tables.condense import condense
    from pipelines.tables.dwells import lot_of, measured

    made = make(world, seed)
    run = ExaminedRun(lot_of(measured(condense(made.dwells), made.history), square=False), BASE)
    run.removed = bad_dwells(run.model())
    return run


@lru_cache(maxsize=32)
def readings_of(world: World, seed: int) -> Readings:
    """The readings of a lot."""
    from pipelines.tables.condense import condense
    from pipelines.tables.dwells import measured

    made = make(world, seed)
    return measured(condense(made.dwells), made.history).readings


def coarse_steps(world: World, seed: int) -> Counts:
    """Units whose converter is called coarser than the noise of a sample."""
    from inertial.data_errors.faults import find_faults

    found = find_faults(readings_of(world, seed))
    return sum(f.name == "quantised" for f in found), world.units


def together(world: World, seed: int) -> Counts:
    """Lots whose units are taken to share noise where two rivals are compared."""
    from inertial import effects as catalogue
    from inertial.estimation.likelihood import shared_factor
    from inertial.estimation.model import Model
    from inertial.estimation.term import Term

    model = run_of(world, seed).model()
    terms = [*model.terms, Term(catalogue.get("second_order"))]
    return int(shared_factor(Model(model.problem, terms, near=model.noise), terms[-1]) > 1.0), 1


def folds(world: World, seed: int) -> Counts:
    """Soaks left out in turn that can judge a model with a square of the temperature."""
    from inertial import effects as catalogue
    from inertial.criticism.left_out import left_out
    from inertial.estimation.model import Model
    from inertial.estimation.refinement import terms_of

    model = run_of(world, seed).model()
    terms = terms_of(catalogue.get_all([*BASE, "bias_temperature_quadratic"]), model.problem)
    return int("soaks" in left_out(Model(model.problem, terms, near=model.noise)).density), 1


def axes(world: World, seed: int) -> Counts:
    """Effects with one value of their parameter for all axes that get one for each axis."""
    from inertial import effects as catalogue
    from inertial.design import grid_of
    from inertial.estimation.refinement import refine
    from inertial.estimation.term import Term

    model = run_of(world, seed).model()
    split = 0
    names = [name for name, _ in world.hidden] or ["warm_up", "thermal_lag", "thermal_kink"]
    for name in names:
        effect = catalogue.get(name)
        grid = grid_of(effect, model.problem.lot.state)
        term = Term(effect, tuple(grid[len(grid) // 2].items()))
        for _ in range(3):
            term = refine(model, term, model.with_term(term).noise)
        split += any(isinstance(v, tuple) for v in term.keywords.values())
    return split, len(names)


def drivers(world: World, seed: int) -> Counts:
    """Recorded quantities that the residual follows by chance or not, large enough to be called unexplained."""
    from inertial import decisions
    from inertial.criticism.drivers import drivers_of

    model = run_of(world, seed).model()
    floor, every = model.floor(), drivers_of(model.problem)
    return sum(model.explained(d.candidate, floor) >= decisions.UNEXPLAINED * floor for d in every), len(every)


PARTS: dict[str, Part] = {
    "STEPS_UNEVEN": (
        coarse_steps,
        {
            "no step": World(),
            "tails of t3": NULLS["t3"],
            "step of the noise": replace(NULLS["lsb5"], lsb=1.0),
            "twice": replace(NULLS["lsb5"], lsb=2.0),
            "five times": NULLS["lsb5"],
        },
    ),
    "UNITS_TOGETHER": (together, {"units of their own": World(), "table at rest ± 20 µrad": NULLS["rest20"]}),
    "FOLD_BLIND": (
        folds,
        {"three soaks": World(), "five soaks": World(poses=15, soaks=(-10.0, 10.0, 25.0, 45.0, 60.0))},
    ),
    "AXES_DIFFER": (
        axes,
        {
            "noise alone": World(),
            "warm-up of size 2": HIDDEN["warm_up_2"],
            "warm-up of size 10": World(hidden=(("warm_up", 10.0),)),
            "kink of size 10": World(
                poses=8, soaks=tuple(float(t) for t in range(-10, 61, 7)), hidden=(("thermal_kink", 10.0),)
            ),
        },
    ),
    "UNEXPLAINED": (
        drivers,
        {
            "noise alone": World(),
            "K 4": NULLS["K4"],
            "square of the temperature, size 1": HIDDEN["bias_temperature_quadratic_1"],
            "size 2": HIDDEN["bias_temperature_quadratic_2"],
        },
    ),
}
PARTS["STEPS_FOLLOW"] = PARTS["STEPS_UNEVEN"]


def lines(name: str, part: Part, runs: int, first: int, rate: Callable[[int, int], Any]) -> Iterator[str]:
    """A line for every world, the decision at half, at its value and at twice as much."""
    decide, worlds = part
    for place, (title, world) in enumerate(worlds.items()):
        counts = dict.fromkeys(FACTORS, (0, 0))
        for seed in range(SEED + 10_000 * place + first, SEED + 10_000 * place + first + runs):
            for factor in FACTORS:
                with changed(name, factor):
                    taken, of = decide(world, seed)
                counts[factor] = counts[factor][0] + taken, counts[factor][1] + of
        cells = [f"×{factor:g}: {rate(*count) if count[1] else 'none'}" for factor, count in counts.items()]
        yield f"{title}: taken {'; '.join(cells)}"
