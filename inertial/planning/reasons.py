"""Why a plan cannot see an effect, in words: what in the plan makes its column vanish or alias, and what breaks that.

Nothing here knows an effect by name. Features of the plan are found ("β in 90° steps"), each with a change that removes it
("poses at β = 45°"); the change that lets the effect show tells which feature hid it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial import design, frames
from inertial import effects as catalogue
from inertial.effects import SensorEffect
from inertial.effects.base import AnyEffect, excited
from inertial.errors import MissingInput
from inertial.planning import visibility
from inertial.planning.changes import CHANGES, Driver, PlanChange
from inertial.planning.sequences import SequenceStep, StationPace, extended
from inertial.planning.wording import signature, symbol
from inertial.quantities import column_of
from inertial.state import State

Array = NDArray[np.float64]

ENOUGH = 0.05
"""Part v above which a change of the plan counts as a cure."""

_PLAIN = ("bias", "scale", "misalignment")
_VANISHED = 1e-6
_BETTER = 1.5
_ABSORBED = 0.05
_ERROR = 1e-5
_OFF_S = 600.0


@dataclass(frozen=True)
class Cause:
    """Why an effect is not seen.

    found : what in the plan hides it ("β in 90° steps"); empty where nothing that a station does would show it
    does : what that makes of its column ("makes fx·fy zero")
    result : what follows ("Kip is invisible")
    cure : what to add ("add poses at β = 45°")
    """

    found: str
    does: str
    result: str
    cure: str

    def __str__(self) -> str:
        """The sentence."""
        what = f"{self.found} {self.does}: {self.result}" if self.found else f"{self.does}: {self.result}"
        return f"{what}; {self.cure}" if self.cure else what


def reason(state: State, effect_id: str, base: Sequence[str], *, axis: int | None = None) -> str:
    """Why a plan does not see an effect, in one sentence; empty where it sees it.

    Parameters
    ----------
    state : the dwells of one unit or a lot, planned or measured
    effect_id : of the catalogue
    base : ids of the model that is fitted anyway; with a rival in it, why the two are not told apart
    axis : of the sensor; the best of the three where None
    """
    found = cause(state, effect_id, base, axis=axis)
    return "" if found is None else str(found)


def cause(state: State, effect_id: str, base: Sequence[str], *, axis: int | None = None) -> Cause | None:
    """Why a plan does not see an effect, in parts; None where it sees it."""
    one = _one(state)
    effect = catalogue.get(effect_id)
    lacking = _lacking(one, effect)
    if lacking:
        carried = column_of(lacking)
        return Cause("", f"the dwells carry no {carried}", f"{symbol(effect)} is invisible", f"record {carried}")
    if _left(one, effect_id, base, axis) > visibility.SEEN:
        return None
    place, column, vanished = _column(one, effect, axis)
    term = signature(effect, place, column)
    name = symbol(effect, column)
    behind: list[str] = []
    if vanished:
        does, result = f"makes {term} zero", f"{name} is invisible"
    else:
        behind = _absorbed(one, effect, base, place, column)
        told = " and ".join(behind) or "the model"
        does, result = f"makes {term} one with {told}", f"{name} hides behind {told}"
    changes = _hiding(one, effect_id, base, axis, [] if vanished else behind)
    if not changes:
        subject = does.removeprefix("makes ").replace(" one with ", " is one with ").replace(" zero", " is zero")
        return Cause("", f"{subject} in every pose and at every temperature", result, catalogue.get(effect_id).breaker)
    found = " and ".join(c.found(one) for c in changes)
    does = does if len(changes) == 1 else does.replace("makes", "together make", 1)
    return Cause(found, does, result, " and ".join(c.cure(one) for c in changes))


def likeness(state: State, one: str, other: str, base: Sequence[str]) -> str:
    """What in a plan makes one effect look like another beside a model, in words; empty where no feature of the plan does."""
    state, held = _one(state), [*base, other]
    try:
        now = _left(state, one, held, None)
        if now <= visibility.SEEN:
            hidden = cause(state, one, held)
            return "" if hidden is None else f"{hidden.found} {hidden.does}".strip()
        effect = catalogue.get(one)
        answers = drivers_of(state, effect) | drivers_of(state, catalogue.get(other))
    except MissingInput:
        return ""
    there = [c for c in CHANGES if c.driver in answers and c.found(state)]
    better = [(c, _left(c.made(state), one, held, None)) for c in there]
    best = next((c for c, v in better if v > _BETTER * now), None)
    if best is None:
        return ""
    place, column, _ = _column(state, effect, None)
    return f"{best.found(state)} leaves {100.0 * now:.0f} % of {signature(effect, place, column)} beside {other}"


def hiding(state: State, drivers: set[Driver]) -> str:
    """The first feature of a plan that keeps one of these quantities from varying; empty where none does."""
    one = _one(state)
    return next((found for c in CHANGES if c.driver in drivers and (found := c.found(one))), "")


def _one(state: State) -> State:
    """The first unit of a lot."""
    while state.batch:
        state = state.pick(np.array([0], dtype=np.intp)) if state.batch[0] != 1 else state
        state = _dropped(state)
    return state


def _dropped(state: State) -> State:
    """A lot of one unit as that unit."""
    changed: dict[str, object] = {}
    for name, value in vars(state).items():
        if isinstance(value, np.ndarray):
            changed[name] = value[0]
        elif name == "covariates":
            changed[name] = {k: v[0] for k, v in state.covariates.items()}
    if state.history is not None:
        changed["history"] = replace(state.history, temperature=state.history.temperature[0])
    fields = {k: v for k, v in changed.items() if k in State.__dataclass_fields__}
    return replace(state, **fields, memory={})  # pyright: ignore[reportArgumentType]  # arrays stay arrays


def _lacking(state: State, effect: AnyEffect) -> str:
    """The quantity that the dwells do not carry and the effect needs; empty where they carry all."""
    try:
        values = design.starting_values([effect], state).get(effect.id, {})
        _columns(state, effect, values, 0)
    except MissingInput as missing:
        return missing.quantity
    return ""


def _left(state: State, effect_id: str, base: Sequence[str], axis: int | None) -> float:
    """Part v of an effect that the model leaves."""
    sight = visibility.sights(state, base, _ERROR, [effect_id])
    if not sight:
        return 0.0
    return sight[0].left if axis is None else sight[0].by_axis[axis]


def _columns(state: State, effect: AnyEffect, values: dict[str, float], axis: int) -> Array:
    """Columns of an effect on one axis, (n, p)."""
    if isinstance(effect, SensorEffect):
        found = excited(effect, effect.columns(state, axis, **values))
        return np.broadcast_to(found, (state.force.shape[-2], found.shape[-1]))
    return effect.force_change(state, **values)[:, axis, :]


def _column(state: State, effect: AnyEffect, axis: int | None) -> tuple[int, int, bool]:
    """The axis and column to speak of, and whether it vanishes: one that vanishes under the plan before one that aliases."""
    values = design.starting_values([effect], state).get(effect.id, {})
    axes = range(3) if axis is None else (axis,)
    fallback = (axes[0], 0, True)
    for place in axes:
        size = np.sqrt(np.mean(_columns(state, effect, values, place) ** 2, axis=0))
        if size.size and np.all(size < _VANISHED):
            return place, 0, True
        if size.size:
            fallback = (place, int(np.argmax(size)), False)
    return fallback


def _absorbed(state: State, effect: AnyEffect, base: Sequence[str], axis: int, column: int) -> list[str]:
    """The fewest effects of the model, one after the other, that take the column in."""
    values = design.starting_values([effect], state).get(effect.id, {})
    wanted = _columns(state, effect, values, axis)[:, column]
    whole = float(np.linalg.norm(wanted))
    parts = {e.id: _columns(state, e, v, axis) for e, v in _valued(state, base or _PLAIN)}
    chosen: list[str] = []
    left = whole
    while parts and left > _ABSORBED * whole and len(chosen) < 3:
        held = [p for n, p in parts.items() if n in chosen]
        rest = {n: _after(wanted, [*held, p]) for n, p in parts.items() if n not in chosen}
        if not rest:
            break
        best = min(rest, key=lambda n: rest[n])
        if rest[best] > 0.9 * left:
            break
        chosen, left = [*chosen, best], rest[best]
    return chosen


def _valued(state: State, base: Sequence[str]) -> list[tuple[AnyEffect, dict[str, float]]]:
    effects = catalogue.get_all(base)
    return [(e, design.starting_values([e], state).get(e.id, {})) for e in effects]


def _after(wanted: Array, parts: Sequence[Array]) -> float:
    """Norm of what some columns leave of another."""
    x = np.concatenate(parts, axis=1)
    size = np.linalg.norm(x, axis=0)
    fitted = x / np.where(size > 0.0, size, 1.0)
    return float(np.linalg.norm(wanted - fitted @ np.linalg.lstsq(fitted, wanted, rcond=1e-9)[0]))


def _hiding(
    state: State, effect_id: str, base: Sequence[str], axis: int | None, behind: Sequence[str]
) -> list[PlanChange]:
    """The fewest features of the plan without which the effect would show; none where no change helps."""

    def cured(changed: State) -> bool:
        return _left(changed, effect_id, base, axis) >= ENOUGH

    answers = drivers_of(state, catalogue.get(effect_id)).union(
        *(drivers_of(state, e) for e, _ in _valued(state, behind))
    )
    there = [c for c in CHANGES if c.driver in answers and c.found(state)]
    there.sort(key=lambda c: c.driver == "force" and answers != {"force"})
    for change in there:
        if cured(change.made(state)):
            return [change]
    if len(there) < 2 or not cured(_all(state, there)):
        return []
    kept = there
    for change in there:
        fewer = [c for c in kept if c is not change]
        if fewer and cured(_all(state, fewer)):
            kept = fewer
    return kept


def begins_again(state: State, effect_id: str) -> bool:
    """Whether an effect is another one after the devices were off for a while than if they had stayed on."""
    one = _one(state)
    step = SequenceStep(0.0, 0.0, 25.0)
    off, on = (
        extended(one, [replace(step, off=seconds)], StationPace(rest=_OFF_S - seconds)) for seconds in (_OFF_S, 0.0)
    )
    effect = catalogue.get(effect_id)
    values = design.starting_values([effect], one).get(effect.id, {})
    there = [_columns(of, effect, values, axis)[-1] for of in (off, on) for axis in range(3)]
    return not np.allclose(np.concatenate(there[:3]), np.concatenate(there[3:]), rtol=1e-3, atol=1e-9)


def drivers_of(state: State, effect: AnyEffect) -> set[Driver]:
    """What an effect answers to: quantities whose change changes its column, and the order of the dwells."""
    state = _one(state)
    values = design.starting_values([effect], state).get(effect.id, {})

    def columns(of: State) -> Array:
        return np.concatenate([_columns(of, effect, values, axis) for axis in range(3)], axis=1)

    here = columns(state)
    found: set[Driver] = set()
    for driver, changed in _stirred(state):
        if not np.allclose(here, columns(changed), rtol=1e-6, atol=1e-9):
            found.add(driver)
    if {"temperature", "time"} <= found:
        found.add("rate")
    if "since_power" in found:
        found.add("time")
    turned = _reordered(state)
    if not np.allclose(columns(turned)[::-1], here, rtol=1e-6, atol=1e-9):
        found.add("order")
    return found


def _stirred(state: State) -> list[tuple[Driver, State]]:
    """The plan with one quantity after the other changed."""
    rng = np.random.default_rng(1)
    n = state.force.shape[-2]
    turn = rng.uniform(0.2, 1.2, size=(2, n))
    made: list[tuple[Driver, State]] = []
    if state.outer is not None and state.inner is not None:
        outer, inner = state.outer + turn[0], state.inner + turn[1]
        force = frames.force_from_angles(outer, inner)
        made.append(("force", replace(state, outer=outer, inner=inner, force=force, felt=None, memory={})))
    else:
        made.append(("force", replace(state, force=np.roll(state.force, 1, axis=-1) + 0.1, felt=None, memory={})))
    begin = float(np.min(state.time))
    span = max(float(np.ptp(state.time)), 1.0)
    late = begin + span * ((state.time - begin) / span) ** 1.5
    made.append(("time", replace(state, time=late, history=None, memory={})))
    if state.temperature is not None:
        warm = state.temperature + rng.uniform(1.0, 15.0, size=n)
        made.append(("temperature", replace(state, temperature=warm, history=None, memory={})))
    for name in ("since_move", "since_power", "supply", "vibration"):
        value = getattr(state, name)
        if value is not None:
            changed: dict[str, Any] = {name: value * (1.0 + turn[0])}
            made.append((name, replace(state, **changed, memory={})))  # pyright: ignore[reportArgumentType]
    return made


_ROWS = (
    "time", "temperature", "chamber", "outer", "inner", "supply", "vibration", "since_move", "since_power", "power_off",
    "felt",
)  # fmt: skip


def _reordered(state: State) -> State:
    """The plan with its dwells in the opposite order: an effect without memory has the same column, turned about."""
    changed: dict[str, Any] = {"history": None, "memory": {}, "force": state.force[::-1]}
    for name in _ROWS:
        value = getattr(state, name)
        changed[name] = None if value is None else value[::-1]
    changed["covariates"] = {k: v[::-1] for k, v in state.covariates.items()}
    return replace(state, **changed)


def _all(state: State, changes: Sequence[PlanChange]) -> State:
    makers: list[Callable[[State], State]] = [c.made for c in changes]
    for make in makers:
        state = make(state)
    return state
