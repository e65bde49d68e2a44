"""Ranges of a nonlinear parameter in which a plan cannot see an effect that it sees elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass

from inertial.design import resting_grid
from inertial.effects.base import AnyEffect
from inertial.state import State


@dataclass(frozen=True)
class UnseenRange:
    """Values of a parameter, from the lowest to the highest that was tried, at which an effect is not visible."""

    parameter: str
    unit: str
    low: float
    high: float

    def __str__(self) -> str:
        name, unit = self.parameter.replace("_", " "), {"degC": "°C"}.get(self.unit, self.unit)
        low, high = _plain(self.low), _plain(self.high)
        return f"{name} {low} {unit}" if self.low == self.high else f"{name} {low} to {high} {unit}"


def _plain(value: float) -> str:
    """Three significant digits, without an exponent from 0.0001 to 10 million."""
    rounded = float(f"{value:.3g}")
    return f"{rounded:.0f}" if 1000.0 <= abs(rounded) < 1e7 else f"{rounded:g}"


def unseen_ranges(effect: AnyEffect, state: State, seen: Sequence[bool]) -> tuple[UnseenRange, ...]:
    """Ranges of each parameter in which an effect is not visible whatever the others are; empty where it never is.

    Parameters
    ----------
    seen : whether it is visible at each set of values of :func:`inertial.design.resting_grid`
    """
    grid = resting_grid(effect, state)
    if not any(seen) or all(seen):
        return ()
    ranges: list[UnseenRange] = []
    for parameter in effect.parameters(state):
        if parameter.choices or parameter.of_run:
            continue
        at = {float(v): False for v in sorted(parameter.grid().tolist())}
        for values, there in zip(grid, seen, strict=True):
            at[float(values[parameter.name])] |= bool(there)
        begun: list[float] = []
        for value, there in [*at.items(), (float("nan"), True)]:
            if not there:
                begun.append(value)
            elif begun:
                ranges.append(UnseenRange(parameter.name, parameter.unit, begun[0], begun[-1]))
                begun = []
    return tuple(ranges)
