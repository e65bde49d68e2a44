"""Decisions of the search for effects at half, at their value and at twice as much, each search made once.

`python benchmarks/characteristics.py --only CURVE_AHEAD` and the other names of `SEARCH_PARTS`.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from decision_parts import Counts, Part, run_of
from decisions import WORLDS
from tables import HIDDEN, NULLS
from world import World

if TYPE_CHECKING:
    from inertial.criticism.field import Candidates, Rival
    from inertial.criticism.lot_part import LotPart
    from inertial.criticism.search import SearchResult
    from inertial.estimation.model import Model


@lru_cache(maxsize=32)
def candidates(world: World, seed: int) -> tuple[Candidates, Model]:
    """The candidates of a lot, and its model."""
    from inertial.criticism.examination import candidates_of
    from inertial.criticism.field import Candidates
    from inertial.data_errors.handling import alternatives

    run = run_of(world, seed)
    model = run.model()
    return Candidates(model.problem, candidates_of(model, run.effects), alternatives()), model


@lru_cache(maxsize=32)
def searched(world: World, seed: int) -> tuple[LotPart, SearchResult]:
    """The effects that a search finds in a lot, without a curve that ends it."""
    from inertial.criticism.lot_part import LotPart
    from inertial.criticism.search import search

    field, model = candidates(world, seed)
    return LotPart(field, model), search(field, model, stop=lambda _: False)


@lru_cache(maxsize=32)
def rivals(world: World, seed: int) -> tuple[Rival, ...]:
    """The rivals of the first step of a search."""
    from inertial.criticism.search import contest

    return tuple(contest(*candidates(world, seed)))


def curve(world: World, seed: int) -> Counts:
    """Lots in which a curve of one driver is preferred to the effects that were found."""
    from inertial.criticism.unknown import better_curve

    part, result = searched(world, seed)
    return int(
        bool(result.added) and better_curve(part.base, result.added, part.suspected(result.added)) is not None
    ), 1


def in_class(world: World, seed: int) -> Counts:
    """Lots in which what is hidden is in the class of the first effect that is found."""
    from inertial.criticism.classes import class_of

    part, result = searched(world, seed)
    if not result.added:
        return 0, 1
    return int(world.hidden[0][0] in class_of(part.field, result.model, result.added[0]).ids), 1


def contested(world: World, seed: int) -> Counts:
    """Lots in which what is hidden is named in the first step of a search, or anything where nothing is."""
    from inertial.criticism.search import contest, convincing

    field, model = candidates(world, seed)
    return _named(world, [r for r in contest(field, model) if convincing(field, model, r)])


def material(world: World, seed: int) -> Counts:
    """The same, of rivals that are known."""
    from inertial.criticism.search import convincing

    field, model = candidates(world, seed)
    return _named(world, [r for r in rivals(world, seed) if convincing(field, model, r)])


def _named(world: World, found: list[Any]) -> Counts:
    own = {name for name, _ in world.hidden}
    return int(any(not own or r.term.effect.id in own for r in found)), 1


def tails(world: World, seed: int) -> Counts:
    """Dwells left out that are named as faults, of those left out."""
    from inertial.data_errors.tails import with_tails

    run = run_of(world, seed)
    listed = with_tails(run.model(), run.removed)
    return sum(not d.tail for d in listed), len(listed)


_KNOWN = {name: WORLDS[name] for name in ("third_order_2", "warm_up_1", "two_effects", "band")}
_SLOW = {name: HIDDEN[name] for name in ("aging_linear_1", "warm_up_1")}
_UP = World(units=4, poses=9, soaks=(0.0, 20.0, 40.0, 60.0), hours=1.2, hidden=(("step_change", 4.0),))
SEARCH_PARTS: dict[str, Part] = {
    **dict.fromkeys(("CURVE_AHEAD", "CURVE_SHARE"), (curve, _KNOWN)),
    "RIVAL_NEAR": (
        in_class,
        {**{name: WORLDS[name] for name in ("bias_temperature_quadratic_2", "warm_up_1")}, "step, soaks up": _UP},
    ),
    **dict.fromkeys(("LESS_WALK", "LESS_FLICKER"), (contested, {**_SLOW, "null_K4": NULLS["K4"]})),
    "MATERIAL": (material, {**_SLOW, "third_order_1": HIDDEN["third_order_1"], "null_K4": NULLS["K4"]}),
    "TAILS": (
        tails,
        {"t3": NULLS["t3"], "t3, one unit": NULLS["t3_one_unit"], "a dwell off by 0.5 mg": WORLDS["dwell"]},
    ),
}
