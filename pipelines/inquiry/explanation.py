"""Sentences that explain a proposed measurement."""

from collections.abc import Sequence

import numpy as np

from inertial import frames
from inertial.counts import number_of
from inertial.next_measurement.menus import Kind
from inertial.next_measurement.proposals import Proposal
from inertial.planning.reasons import begins_again, confounding_feature, constant_feature, reason
from inertial.planning.remedies import Driver
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
"""Quantities that the steps of each kind vary; features of the plan that keep them constant explain the confounding."""


def why(state: State, base: Sequence[str], proposal: Proposal) -> str:
    """Why a measurement is proposed, in one sentence: the confounded rivals, the cause, the measurement, and the gain.

    state : the dwells so far
    base : ids of the model beside the rivals
    """
    first, second = proposal.pair
    rivals = " and ".join([", ".join(proposal.ids[:-1]), proposal.ids[-1]])
    hidden = _hidden(state, base, proposal.kinds, first, second)
    gain = f"χ² between {first} and {second} is expected to rise from {proposal.before:.1f} to {proposal.after:.0f}"
    steps = f"{what(state, proposal)} discriminates between them"
    return f"{rivals} fit equally well: {hidden}. {steps} ({gain}; {proposal.minutes:.1f} min)"


def shows(state: State, base: Sequence[str], proposal: Proposal) -> str:
    """Why a measurement is proposed for effects that are not visible, in one sentence."""
    hidden = dict.fromkeys(r.split("; ")[0] for name in proposal.ids if (r := reason(state, name, base)))
    gain = f"χ² of a coefficient of typical size rises from {proposal.before:.1f} to at least {proposal.after:.0f}"
    shown = f"{what(state, proposal)} makes {', '.join(proposal.ids)} visible"
    return f"{'; '.join(hidden)}. {shown} ({gain}; {proposal.minutes:.1f} min)"


def _hidden(state: State, base: Sequence[str], kinds: Sequence[Kind], first: str, second: str) -> str:
    """The feature of the plan that makes the rivals similar."""
    confounding = confounding_feature(state, first, second, base)
    if confounding:
        return confounding
    feature = constant_feature(state, {d for kind in kinds for d in VARIED[kind]})
    return f"with {feature or 'the dwells so far'} {first} and {second} differ by less than the noise"


def what(state: State, proposal: Proposal) -> str:
    """The steps of a proposal as text."""
    phrases = {
        "poses": lambda: f"measuring {_directions(proposal.steps)}",
        "soaks": lambda: f"measuring at {_temperatures(proposal.steps)}",
        "waits": lambda: f"waiting {_waits(proposal.steps)} after a move",
        "approach": lambda: "approaching the same poses from both sides",
        "excursion": lambda: f"going to {_temperatures(proposal.steps)} in this order",
        "ramp": lambda: f"measuring while the temperature changes to {_temperatures(proposal.steps)}",
        "later": lambda: f"repeating the same poses after {_waits(proposal.steps)}",
        "power": lambda: f"switching the units off for {off} min: {_power(state, proposal.ids)}",
    }
    off = " and ".join(f"{m:g}" for m in sorted({round(s.off / 60.0, 1) for s in proposal.steps if s.off > 0.0}))
    text = ", and ".join(phrases[kind]() for kind in proposal.kinds)
    return text[:1].upper() + text[1:]


def _directions(steps: Sequence[SequenceStep]) -> str:
    force = np.abs([frames.force_from_angles(s.outer, s.inner) for s in steps])
    levels = sorted({f"{v:.2f}" for v in np.round(force[(force > 0.02) & (force < 0.98)] / 0.05) * 0.05})
    shown = ", ".join(levels[:4]) + (" …" if len(levels) > 4 else "")
    return number_of(len(steps), "dwell") + (f" with |f| of {shown} g on an axis" if levels else " on faces")


def _temperatures(steps: Sequence[SequenceStep]) -> str:
    stops = [s.temperature for k, s in enumerate(steps) if k == 0 or s.temperature != steps[k - 1].temperature]
    return ", ".join(f"{t:g}" for t in stops) + " °C"


def _waits(steps: Sequence[SequenceStep]) -> str:
    long = sorted({round(s.wait) for s in steps})
    if len(long) == 1 or long[-1] < DRAWN_OUT_S:
        return f"{long[-1]} s"
    return f"{long[0]} to {long[-1]} s"


def _power(state: State, ids: Sequence[str]) -> str:
    """Which effects restart at power-on, and which continue."""
    again = [name for name in ids if begins_again(state, name)]
    on = [name for name in ids if name not in again]
    parts = [(again, "restarts", "restart"), (on, "continues", "continue")]
    return ", ".join(
        f"{' and '.join(names)} {single if len(names) == 1 else many}" for names, single, many in parts if names
    )
