"""Features of a plan that hide effects, each with the smallest change that removes it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from inertial.planning import cures
from inertial.planning import features as has
from inertial.state import State

Driver = Literal["force", "order", "since_move", "temperature", "time", "rate", "since_power", "supply", "vibration"]


@dataclass(frozen=True)
class PlanChange:
    """A feature of plans and its cure.

    driver : what the cure varies; effects that do not answer to it are not helped by it
    found : the feature in words where a plan has it, else empty
    made : the plan with the cure added
    cure : the cure in words
    """

    driver: Driver
    found: Callable[[State], str]
    made: Callable[[State], State]
    cure: Callable[[State], str]


def _said(words: str, when: Callable[[State], bool]) -> Callable[[State], str]:
    """The words of a plan that has a feature, nothing of one that has it not."""
    return lambda state: words if when(state) else ""


def _always(words: str) -> Callable[[State], str]:
    return lambda _state: words


def _degrees(values: list[float]) -> str:
    return ", ".join(f"{v:.0f}" for v in values)


CHANGES: tuple[PlanChange, ...] = (
    PlanChange(
        "force",
        _said("β in 90° steps", lambda s: has.in_steps(s.inner, 90.0)),
        lambda s: cures.with_poses(s, cures.TURNED),
        _always("add poses at β = 45°"),
    ),
    PlanChange(
        "force",
        _said("α in 90° steps", lambda s: has.in_steps(s.outer, 90.0)),
        lambda s: cures.with_poses(s, cures.TILTED),
        _always("add poses at α = 45°"),
    ),
    PlanChange(
        "force",
        has.few_levels_of_force,
        lambda s: cures.with_poses(s, cures.GENERAL),
        _always("add poses in general directions, as the plan fibonacci24 has them"),
    ),
    PlanChange(
        "force",
        _said("having no pose within 0.1 g of zero on either side", has.far_from_zero),
        cures.near_zero,
        _always("add poses that tilt each axis through 0 g by a few tenths of a degree"),
    ),
    PlanChange(
        "order",
        _said("coming to every pose from one side only", has.approached_alike),
        cures.backwards,
        _always("go through the poses again in the opposite order"),
    ),
    PlanChange(
        "since_move",
        _said("one wait after every move", has.one_wait),
        cures.waits,
        _always("wait 5, 20, 60 and 200 s after some moves"),
    ),
    PlanChange(
        "temperature",
        _said("one temperature only", lambda s: has.distinct(s) == 1),
        lambda s: cures.with_soaks(s, cures.up_down(s)),
        lambda s: f"add soaks at {_degrees(cures.up_down(s)[:3:2])} °C, and come back",
    ),
    PlanChange(
        "temperature",
        _said("soaks in one direction only", has.one_way),
        cures.soaks_back,
        lambda s: f"add soaks on the way back, at {_degrees(has.levels(s)[-2::-1])} °C",
    ),
    PlanChange(
        "temperature",
        lambda s: f"having {has.distinct(s)} temperatures only" if 2 <= has.distinct(s) <= 4 else "",
        lambda s: cures.with_soaks(s, cures.more_levels(s)),
        lambda s: f"add soaks at {_degrees(cures.more_levels(s))} °C",
    ),
    PlanChange(
        "time",
        _said("measuring no pose again later", has.never_again),
        cures.later,
        _always("measure the poses again an hour later"),
    ),
    PlanChange(
        "rate",
        _said("reading only when the temperature has settled", has.soaked_only),
        cures.ramps,
        _always("read while the temperature moves, up and down"),
    ),
    PlanChange(
        "since_power",
        _said("one power-on at the beginning", has.powered_once),
        cures.cycled,
        _always("switch the power off and on at constant temperature"),
    ),
    PlanChange(
        "supply",
        _said("a constant supply", lambda s: has.constant(s.supply, 0.005)),
        cures.supply_steps,
        _always("step the supply at constant temperature"),
    ),
    PlanChange(
        "vibration",
        _said("steady vibration", lambda s: has.constant(s.vibration, 0.9)),
        cures.shaken,
        _always("measure with the compressor on and off"),
    ),
)
"""In the order in which a test engineer would rather make them: the cheapest first."""
