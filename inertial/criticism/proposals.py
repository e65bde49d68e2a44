"""The next measurement: poses at which rivals that fit alike would part most."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inertial import frames
from inertial.criticism.classes import EffectClass
from inertial.criticism.heldout import residuals
from inertial.criticism.model import Model, Term
from inertial.criticism.problem import Lot, Problem
from inertial.errors import MissingInput

Array = NDArray[np.float64]

_PROPOSED = 3


@dataclass(frozen=True)
class Proposal:
    """A pose in radians and a temperature in °C that parts two effects, or the breaker in words."""

    outer: float
    inner: float
    temperature: float
    why: str


def proposals(model: Model, group: EffectClass) -> list[Proposal]:
    """Poses where the two best members of a class differ most in what they predict; empty for a class of one."""
    if len(group.members) < 2:
        return []
    first, second = (m.term for m in group.members[:2])
    why = f"{first.effect.id} | {second.effect.id}"
    rest = [t for t in model.terms if t.effect.id not in group.ids]
    try:
        outer, inner, apart = _differences(model.problem, rest, first, second)
    except MissingInput:
        return [Proposal(0.0, 0.0, 25.0, f"{why}: {second.effect.breaker}")]
    if float(apart.max(initial=0.0)) < 1e-9:
        return [Proposal(0.0, 0.0, 25.0, f"{why}: {second.effect.breaker}")]
    found: list[Proposal] = []
    directions = frames.force_from_angles(outer, inner)
    for place in np.argsort(-apart):
        near = [frames.force_from_angles(p.outer, p.inner) @ directions[place] for p in found]
        if all(abs(c) < 0.9 for c in near):
            found.append(Proposal(float(outer[place]), float(inner[place]), 25.0, why))
        if len(found) == _PROPOSED:
            break
    return found


def _differences(problem: Problem, rest: list[Term], one: Term, other: Term) -> tuple[Array, Array, Array]:
    """Angles of a grid of poses, and the RMS difference of the two models' predictions there, g."""
    outer, inner = (
        a.ravel() for a in np.meshgrid(np.radians(np.arange(0, 181, 12)), np.radians(np.arange(-180, 180, 15)))
    )
    lot, count = problem.lot, outer.size
    state = lot.state
    units, n = state.time.shape
    wide = (units, count)
    there = np.broadcast_to(frames.force_from_angles(outer, inner), (*wide, 3))
    force = np.concatenate([state.force, there], axis=1)
    joined = replace(
        state,
        force=force,
        felt=np.einsum("uij,unj->uni", lot.response, force),
        outer=_joined(state.outer, np.broadcast_to(outer, wide)),
        inner=_joined(state.inner, np.broadcast_to(inner, wide)),
        time=_joined(state.time, state.time[:, -1:] + 60.0 * np.arange(1, count + 1)),
        temperature=_joined(state.temperature, np.full(wide, 25.0)),
        chamber=_joined(state.chamber, np.full(wide, 25.0)),
        since_power=_joined(state.since_power, np.full(wide, _last(state.since_power))),
        since_move=_joined(state.since_move, np.full(wide, _middle(state.since_move))),
        supply=_joined(state.supply, np.full(wide, _middle(state.supply))),
        vibration=_joined(state.vibration, np.full(wide, _middle(state.vibration))),
        covariates={k: np.concatenate([v, np.full(wide, _middle(v))], axis=1) for k, v in state.covariates.items()},
        history=None,
        memory={},
    )
    output = np.concatenate([lot.output, np.zeros((*wide, 3))], axis=1)
    error = np.concatenate(
        [lot.error, np.full((*wide, 3), float(np.median(lot.error[np.isfinite(lot.error)])))], axis=1
    )
    wider = Problem(Lot(joined, output, error, lot.response, lot.radial))
    train = np.arange(n + count) < n
    apart = residuals(wider, [*rest, one], train) - residuals(wider, [*rest, other], train)
    return outer, inner, np.sqrt(np.mean(apart[:, n:] ** 2, axis=0))


def _joined(values: Array | None, more: Array) -> Array | None:
    return None if values is None else np.concatenate([values, more], axis=1)


def _middle(values: Array | None) -> float:
    return 0.0 if values is None else float(np.median(values))


def _last(values: Array | None) -> float:
    return 0.0 if values is None else float(np.max(values))
