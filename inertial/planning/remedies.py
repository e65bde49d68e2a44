"""Features of a plan that make effects invisible, each with the smallest change of the plan that removes it."""

from collections.abc import Callable
from dataclasses import dataclass

from inertial.planning import additions, features
from inertial.quantities import LEFT_ALONE, Quantity, Varied
from inertial.state import State

Driver = str
"""An attribute of the state, or "force", "order" of the poses, "rate" of the temperature."""


@dataclass(frozen=True)
class Remedy:
    """A feature of plans that makes effects invisible, and the change that removes it.

    driver : the quantity that the change varies; it only helps effects that depend on this quantity
    feature : description of the feature where a plan has it, else empty
    apply : returns the plan with the change
    cure : the change as an instruction
    """

    driver: Driver
    feature: Callable[[State], str]
    apply: Callable[[State], State]
    cure: Callable[[State], str]


def _where(description: str, condition: Callable[[State], bool]) -> Callable[[State], str]:
    """The description of plans that fulfil a condition, empty for others."""
    return lambda state: description if condition(state) else ""


def _always(instruction: str) -> Callable[[State], str]:
    return lambda _state: instruction


def _degrees(values: list[float]) -> str:
    return ", ".join(f"{v:.0f}" for v in values)


def _of(row: Quantity, varied: Varied) -> Remedy:
    """The remedy of a plan that leaves a quantity alone."""
    return Remedy(
        row.attribute,
        _where(varied.feature, lambda s: features.constant(getattr(s, row.attribute), varied.steady)),
        lambda s: additions.raised(s, row.attribute, varied.factor),
        _always(varied.cure),
    )


REMEDIES: tuple[Remedy, ...] = (
    Remedy(
        "force",
        _where("β in 90° steps", lambda s: features.in_steps(s.inner, 90.0)),
        lambda s: additions.with_poses(s, additions.TURNED),
        _always("add poses at β = 45°"),
    ),
    Remedy(
        "force",
        _where("α in 90° steps", lambda s: features.in_steps(s.outer, 90.0)),
        lambda s: additions.with_poses(s, additions.TILTED),
        _always("add poses at α = 45°"),
    ),
    Remedy(
        "force",
        features.few_levels_of_force,
        lambda s: additions.with_poses(s, additions.GENERAL),
        _always("add poses in general directions, for example the plan fibonacci24"),
    ),
    Remedy(
        "force",
        _where("the absence of poses within ± 0.1 g of zero on every axis", features.far_from_zero),
        additions.near_zero,
        _always("add poses that tilt each axis through 0 g by a few tenths of a degree"),
    ),
    Remedy(
        "order",
        _where("approach of every pose from one side only", features.approached_alike),
        additions.backwards,
        _always("repeat the poses in the opposite order"),
    ),
    Remedy(
        "since_move",
        _where("the same wait after every move", features.one_wait),
        additions.waits,
        _always("wait 5, 20, 60 and 200 s after some moves"),
    ),
    Remedy(
        "temperature",
        _where("a single temperature", lambda s: features.distinct(s) == 1),
        lambda s: additions.with_soaks(s, additions.up_down(s)),
        lambda s: f"add soaks at {_degrees(additions.up_down(s)[:3:2])} °C, and return",
    ),
    Remedy(
        "temperature",
        _where("soaks in one direction only", features.one_way),
        additions.soaks_back,
        lambda s: f"add soaks on the way back, at {_degrees(features.levels(s)[-2::-1])} °C",
    ),
    Remedy(
        "temperature",
        lambda s: f"measurement at {features.distinct(s)} temperatures only" if 2 <= features.distinct(s) <= 4 else "",
        lambda s: additions.with_soaks(s, additions.more_levels(s)),
        lambda s: f"add soaks at {_degrees(additions.more_levels(s))} °C",
    ),
    Remedy(
        "time",
        _where("the absence of repeated poses", features.never_again),
        additions.later,
        _always("measure the poses again an hour later"),
    ),
    Remedy(
        "rate",
        _where("measurement at settled temperatures only", features.soaked_only),
        additions.ramps,
        _always("measure while the temperature rises and falls"),
    ),
    Remedy(
        "since_power",
        _where("a single power-on at the start", features.powered_once),
        additions.cycled,
        _always("switch the power off and on at constant temperature"),
    ),
    *(_of(row, row.varied) for row in LEFT_ALONE if row.varied),
)
"""In order of effort for a test engineer, the least first."""
