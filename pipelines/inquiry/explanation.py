"""Why a measurement is proposed, in the user's terms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inertial import frames
from inertial.criticism.menus import Kind
from inertial.planning.changes import Driver
from inertial.planning.reasons import begins_again, hiding, likeness, reason

if TYPE_CHECKING:
    from collections.abc import Sequence

    from inertial.criticism.proposals import Proposal
    from inertial.planning.sequences import SequenceStep
    from inertial.state import State

DRAWN_OUT_S = 5.0
VARIED: dict[Kind, tuple[Driver, ...]] = {
    "poses": ("force",),
    "soaks": ("temperature",),
    "waits": ("since_move",),
    "approach": ("order",),
    "excursion": ("temperature",),
    "ramp": ("rate", "temperature"),
    "later": ("time", "since_power"),
    "power": ("since_power",),
}
"""What the steps of a kind vary: features of the plan that keep that as it is have hidden the difference."""


def why(state: State, base: Sequence[str], found: Proposal) -> str:
    """One sentence: what hides the difference of the rivals, what is measured, and what it brings.

    Parameters
    ----------
    state : the dwells so far
    base : ids of the model beside the rivals
    """
    first, second = found.pair
    rivals = " and ".join([", ".join(found.ids[:-1]), found.ids[-1]])
    hidden = _hidden(state, base, found.kinds, first, second)
    parted = f"χ² between {first} and its nearest rival goes from {found.before:.1f} to {found.after:.0f}"
    return f"{rivals} fit alike: {hidden}. {what(state, found)} parts them ({parted}; {found.minutes:.1f} min)"


def shows(state: State, base: Sequence[str], found: Proposal) -> str:
    """One sentence: why effects were not seen so far, and what is measured to see them."""
    hidden = dict.fromkeys(r.split("; ")[0] for name in found.ids if (r := reason(state, name, base)))
    least = f"χ² of a coefficient of typical size: {found.before:.1f}, then {found.after:.0f} at least"
    return f"{'; '.join(hidden)}. {what(state, found)} shows {', '.join(found.ids)} ({least}; {found.minutes:.1f} min)"


def _hidden(state: State, base: Sequence[str], kinds: Sequence[Kind], first: str, second: str) -> str:
    """What in the plan makes one rival look like the other."""
    told = likeness(state, first, second, base)
    if told:
        return told
    feature = hiding(state, {d for kind in kinds for d in VARIED[kind]})
    return f"with {feature or 'what was measured'} {first} and {second} differ by less than the noise"


def what(state: State, found: Proposal) -> str:
    """The steps in words."""
    words = {
        "poses": lambda: f"measuring {_directions(found.steps)}",
        "soaks": lambda: f"measuring at {_temperatures(found.steps)}",
        "waits": lambda: f"waiting {_waits(found.steps)} after a move",
        "approach": lambda: "coming to the same poses from both sides",
        "excursion": lambda: f"going to {_temperatures(found.steps)} in this order",
        "ramp": lambda: f"reading while the temperature moves to {_temperatures(found.steps)}",
        "later": lambda: f"measuring the same poses again after {_waits(found.steps)}",
        "power": lambda: f"switching the units off for {_off(found.steps)}: {_power(state, found.ids)}",
    }
    text = ", and ".join(words[kind]() for kind in found.kinds)
    return text[:1].upper() + text[1:]


def _directions(steps: Sequence[SequenceStep]) -> str:
    force = np.abs([frames.force_from_angles(s.outer, s.inner) for s in steps])
    levels = sorted({f"{v:.2f}" for v in np.round(force[(force > 0.02) & (force < 0.98)] / 0.05) * 0.05})
    shown = ", ".join(levels[:4]) + (" …" if len(levels) > 4 else "")
    return f"{len(steps)} dwells" + (f" with |f| of {shown} g on an axis" if levels else " on faces")


def _temperatures(steps: Sequence[SequenceStep]) -> str:
    stops = [s.temperature for k, s in enumerate(steps) if k == 0 or s.temperature != steps[k - 1].temperature]
    return ", ".join(f"{t:g}" for t in stops) + " °C"


def _waits(steps: Sequence[SequenceStep]) -> str:
    long = sorted({round(s.wait) for s in steps})
    if len(long) == 1 or long[-1] < DRAWN_OUT_S:
        return f"{long[-1]} s"
    return f"{long[0]} to {long[-1]} s"


def _off(steps: Sequence[SequenceStep]) -> str:
    minutes = sorted({round(s.off / 60.0, 1) for s in steps if s.off > 0.0})
    return " and ".join(f"{m:g}" for m in minutes) + " min"


def _power(state: State, ids: Sequence[str]) -> str:
    """Which of some effects begin again with the power, and which go on without it."""
    again = [name for name in ids if begins_again(state, name)]
    on = [name for name in ids if name not in again]
    parts = [(again, "begins again", "begin again"), (on, "goes on", "go on")]
    return ", ".join(f"{' and '.join(names)} {one if len(names) == 1 else many}" for names, one, many in parts if names)
