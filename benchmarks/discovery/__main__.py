"""Discoveries in archives: ``python -m benchmarks.discovery null|power|names|sizes|unexplained|cost [--archives N] [--seed S]``.

Prints for each world how many archives without anything hidden showed a discovery in 100 nights; for hidden effects the lots
after which 95 % of the archives had found them; how often effect and driver were named, or the effect was said to be like none of
the catalogue; and what a lot and a night cost.
"""

from __future__ import annotations

import argparse
import random
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from multiprocessing import get_context
from typing import Any

import numpy as np
from scipy import stats

from benchmarks.discovery.archives import ArchiveMaker, Hidden, Result, Setting
from benchmarks.discovery.cost import cost
from benchmarks.discovery.lots import FLOOR_UG, WORLDS, World, bank
from inertial.discovery.level_fit import WIDE
from inertial.discovery.naming import Name, Pool, Unnamed

BANK = 120
SETTINGS = (
    ("stations stay", Setting()),
    ("one lot in 100 with noise × 20", Setting(bad=0.01)),
    ("units come again", Setting(again=0.5)),
    ("cubic of 0.01 floors wanders over 100 lots", Setting(wander=0.01)),
    ("cubic of 0.03 floors wanders over 30 lots", Setting(wander=0.03, over=30.0)),
    ("cubic of 0.03 floors wanders over 400 lots", Setting(wander=0.03, over=400.0)),
    ("one station, cubic of 0.02 floors over 100 lots", Setting(stations=1, wander=0.02)),
)
POWER = (
    Hidden("third_order", "mean", 0.01), Hidden("third_order", "wafer", 0.01), Hidden("third_order", "station", 0.01),
    Hidden("cross_coupling", "slot", 0.01), Hidden("third_order", "radius", 0.01), Hidden("second_order", "firmware", 0.01),
)  # fmt: skip
NAMES = tuple(
    Hidden(effect, driver, 0.03)
    for effect in (
        "third_order", "second_order", "cross_coupling", "bias_temperature_quadratic", "scale_temperature_quadratic",
        "creep_after_move",
    )
    for driver in ("mean", "wafer", "station", "slot", "radius", "firmware")
)  # fmt: skip
_makers: dict[str, ArchiveMaker] = {}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("null", "power", "names", "sizes", "unexplained", "cost"))
    parser.add_argument("--archives", type=int, default=20)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6))
    parser.add_argument("--lots", type=int, default=10_000, help="of the archive whose cost is measured")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    print(f"seed {given.seed}")
    if given.what == "cost":
        cost(given.lots, given.seed)
        return
    {"null": null, "power": power, "names": names, "sizes": sizes, "unexplained": unexplained}[given.what](given)


def _maker(world: World, seed: int) -> ArchiveMaker:
    if world.name not in _makers:
        _makers[world.name] = ArchiveMaker(bank(world, BANK, seed), world)
    return _makers[world.name]


def _map(function: Callable[[Any], Any], parts: list[Any], jobs: int) -> list[Any]:
    if jobs < 2:
        return [function(part) for part in parts]
    with get_context("fork").Pool(jobs) as pool:
        return pool.map(function, parts, chunksize=1)


def null(given: argparse.Namespace) -> None:
    """Archives of 2000 lots without anything hidden, for each world and each setting."""
    rows = [(world, SETTINGS[0]) for world in WORLDS] + [(WORLDS[1], setting) for setting in SETTINGS[1:]]
    total, false = 0, 0
    for world, (name, setting) in rows:
        _maker(world, given.seed)
        parts = [(world, given.seed, given.seed + k, setting) for k in range(given.archives)]
        found = [drivers for drivers in _map(_null, parts, given.jobs) if drivers]
        total, false = total + given.archives, false + len(found)
        counts = Counter(driver for drivers in found for driver in drivers)
        told = ", ".join(f"{driver} {count}" for driver, count in counts.most_common())
        print(f"{world.name}; {name}: {len(found)} of {given.archives} {told}", flush=True)
    print(f"all: {false} of {total} {_interval(false, total)}")


def _null(part: tuple[World, int, int, Setting]) -> list[str]:
    world, seed, own, setting = part
    first = _maker(world, seed).archive(own, 2000, Hidden(), setting).first
    # a station whose references are wrong does differ from the others
    return [name for name in first if not (setting.wander and name == "station")]


def power(given: argparse.Namespace) -> None:
    """Lots after which 95 % of the archives had found the hidden effect."""
    for world in WORLDS[:2]:
        _maker(world, given.seed)
        for hidden in POWER:
            parts = [(world, given.seed, given.seed + k, hidden) for k in range(given.archives)]
            lots = sorted(_map(_power, parts, given.jobs))
            at = lots[min(int(np.ceil(0.95 * len(lots))) - 1, len(lots) - 1)]
            text = f"{hidden.effect} by {hidden.driver}, {hidden.size:g} floors; {world.name}"
            print(f"{text}: half at {lots[len(lots) // 2]}, 95 % at {at} lots", flush=True)


def _power(part: tuple[World, int, int, Hidden]) -> float:
    world, seed, own, hidden = part
    count = 1200
    first = _maker(world, seed).archive(own, count, hidden, Setting(), until=hidden.driver).first
    found = [lots for name, lots in first.items() if name.split(",")[0] == hidden.driver]
    if not found:
        return float("inf")
    return min(found) - (count // 2 if hidden.driver == "firmware" else 0)


def names(given: argparse.Namespace) -> None:
    """Whether effect and driver are named, and what else."""
    _maker(WORLDS[1], given.seed)
    parts = [(given.seed, given.seed + k, NAMES[k % len(NAMES)]) for k in range(given.archives)]
    told = _map(_names, parts, given.jobs)
    for name, place in (
        ("found", 0),
        ("effect in class", 1),
        ("effect first", 2),
        ("driver in class", 3),
        ("something else named", 4),
    ):
        hits = sum(one[place] for one in told)
        print(f"{name}: {hits} of {len(told)} {_interval(hits, len(told))}")
    _print_pulls([one[6] for one in told])
    for (_, _, hidden), one in zip(parts, told, strict=True):
        if not one[1] or not one[3] or one[4]:
            print(f"  {hidden.effect} by {hidden.driver}: {one[5]}")


def _names(part: tuple[int, int, Hidden]) -> tuple[bool, bool, bool, bool, bool, str, float]:
    told = _told(part)
    if told is None:
        return False, False, False, False, False, "nothing found", np.nan
    found, unnamed, true, hidden = *told, part[2]
    right = [one for one in found if hidden.effect in one.effects]
    driver = any(hidden.driver in one.drivers for one in right)
    first = any(one.effects[0] == hidden.effect for one in right)
    pull = _pull(right, true) if driver else np.nan
    return True, bool(right), first, driver, len(found) > len(right[:1]) or bool(unnamed), _words(*told[:2]), pull


def sizes(given: argparse.Namespace) -> None:
    """How often the interval of a size holds what is hidden in archives of 200 lots, where the name is known."""
    _maker(WORLDS[1], given.seed)
    known = [hidden for hidden in NAMES if hidden.effect != "creep_after_move"]  # its column is that of another time
    parts = [(given.seed, given.seed + k, replace(known[k % len(known)], size=0.1)) for k in range(given.archives)]
    told = _map(_sized, parts, given.jobs)
    _print_pulls(told)
    for (_, _, hidden), pull in zip(parts, told, strict=True):
        print(f"  {hidden.effect} by {hidden.driver}: {pull:.2f}")


def _sized(part: tuple[int, int, Hidden]) -> float:
    seed, own, hidden = part
    maker = _maker(WORLDS[1], seed)
    result = maker.archive(own, 200, hidden, Setting(), keep=True)
    found, _ = Pool(maker.products).names(result.lots, {(hidden.driver, hidden.effect)}, 10.0)
    return _pull([one for one in found if hidden.driver in one.drivers], _true_square(hidden, result))


def _pull(names: list[Name], true: float) -> float:
    """Deviation of the squared size of the first name from the true one over its stated standard deviation; nan: none."""
    square, deviation = names[0].square if names else (np.nan, 1.0)
    return float((square - true) / deviation)


def _true_square(hidden: Hidden, result: Result) -> float:
    """Mean square, g², of what is hidden in the units, of what differs about its mean."""
    size = 1e-6 * FLOOR_UG * np.concatenate(result.hidden)
    return float(np.mean((size - (0.0 if hidden.driver == "mean" else size.mean(axis=0))) ** 2))


def _print_pulls(every: list[float]) -> None:
    pulls = np.array([pull for pull in every if np.isfinite(pull)])
    inside = int(np.count_nonzero(np.abs(pulls) <= WIDE))
    print(f"size within its interval: {inside} of {pulls.size} {_interval(inside, pulls.size)}")
    print(f"pulls of the squared size: mean {pulls.mean():.2f}, rms {np.sqrt(np.mean(pulls**2)):.2f}")


def _told(part: tuple[int, int, Hidden]) -> tuple[list[Name], list[Unnamed], float] | None:
    """Names of an archive, functions of the pose that none of them is, and the true mean square, g²; None: nothing found.

    What differs is about its mean over the units.
    """
    seed, own, hidden = part
    maker = _maker(WORLDS[1], seed)
    result = maker.archive(own, 1000, hidden, Setting(), keep=True)
    if not result.first:
        return None
    needed = maker.state_of(result.evidence).least_needed()
    found, unnamed = Pool(maker.products).names(result.lots, result.alarms, needed)
    return found, unnamed, _true_square(hidden, result)


def unexplained(given: argparse.Namespace) -> None:
    """Whether physics that no effect of the catalogue is like is said to be that, by its driver."""
    _maker(WORLDS[1], given.seed)
    drivers = ("mean", "wafer", "station", "slot", "radius", "firmware")
    parts = [
        (given.seed, given.seed + k, Hidden("twisting_hinge", drivers[k % 6], 0.05)) for k in range(given.archives)
    ]
    told = _map(_told, parts, given.jobs)
    there = [(part[2].driver, one) for part, one in zip(parts, told, strict=True) if one is not None]
    said = sum(any(one.driver == driver for one in unnamed) for driver, (_, unnamed, _) in there)
    named = sum(bool(names) for _, (names, *_) in there)
    for text, hits in (("found", len(there)), ("said to be like no effect", said), ("an effect named, too", named)):
        print(f"{text}: {hits} of {len(told)} {_interval(hits, len(told))}")
    for (_, _, hidden), one in zip(parts, told, strict=True):
        print(f"  {hidden.driver}:", "nothing" if one is None else _words(*one[:2]))


def _words(found: list[Name], unnamed: list[Unnamed]) -> str:
    texts = [f"{' | '.join(one.effects)} by {' | '.join(one.drivers)}" for one in found]
    return "; ".join([*texts, *(f"a function of the pose by {one.driver}" for one in unnamed)])


def _interval(hits: int, n: int) -> str:
    low, high = stats.binomtest(hits, n).proportion_ci(0.95, "exact")
    return f"[{low:.3f}, {high:.3f}]"


if __name__ == "__main__":
    main()
