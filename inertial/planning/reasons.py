"""Reasons why an effect is not visible under a plan, as sentences: the feature of the plan, its consequence, and the remedy.

No effect is treated by name. Each feature of a plan ("β in 90° steps") has a remedy ("add poses at β = 45°"); the remedy that
makes the effect visible identifies the feature responsible.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial import design
from inertial import effects as catalogue
from inertial.arrays import Array
from inertial.effects import SensorEffect
from inertial.effects.base import AXES, AnyEffect, others
from inertial.errors import MissingInput
from inertial.planning import visibility
from inertial.planning.drivers import begins_again, columns_of, drivers_of, first_unit
from inertial.planning.remedies import REMEDIES, Driver, Remedy
from inertial.quantities import column_of
from inertial.state import State

__all__ = ["Cause", "begins_again", "cause", "confounding_feature", "constant_feature", "drivers_of", "reason"]

ENOUGH = 0.05
"""Remaining fraction v from which a remedy counts as effective."""

_MINIMAL = ("bias", "scale", "misalignment")
_VANISHED = 1e-6  # RMS of a column below which it counts as zero
_BETTER = 1.5  # factor by which a remedy must increase the remaining fraction of a visible effect
_ABSORBED = 0.05  # fraction of a column's norm below which it counts as absorbed by the model
_ERROR = 1e-5


@dataclass(frozen=True)
class Cause:
    """Why an effect is not visible.

    feature : of the plan ("β in 90° steps"); empty where no remedy on a station helps
    consequence : for the column ("makes fx·fy zero")
    result : for the coefficient ("Kip is invisible")
    cure : instruction ("add poses at β = 45°")
    """

    feature: str
    consequence: str
    result: str
    cure: str

    def __str__(self) -> str:
        return f"{self.feature} {self.consequence}: {self.result}; {self.cure}".strip()


def reason(state: State, effect_id: str, base: Sequence[str], *, axis: int | None = None) -> str:
    """Why an effect is not visible under a plan, in one sentence; empty where it is visible.

    Parameters
    ----------
    state : the dwells of one unit or a lot, planned or measured
    effect_id : of the catalogue
    base : ids of the base model; with a rival in it, why the two are confounded
    axis : of the sensor; the best of the three where None
    """
    explained = cause(state, effect_id, base, axis=axis)
    return "" if explained is None else str(explained)


def cause(state: State, effect_id: str, base: Sequence[str], *, axis: int | None = None) -> Cause | None:
    """Why an effect is not visible under a plan, in parts; None where it is visible. Parameters as :func:`reason`."""
    unit = first_unit(state)
    effect = catalogue.get(effect_id)
    missing = _missing_quantity(unit, effect)
    if missing:
        column_name = column_of(missing)
        return Cause(
            "", f"the dwells carry no {column_name}", f"{symbol(effect)} is invisible", f"record {column_name}"
        )
    if _remaining_fraction(unit, effect_id, base, axis) > visibility.SEEN:
        return None
    output_axis, column, vanished = _column(unit, effect, axis)
    term = factor_text(effect, output_axis, column)
    name = symbol(effect, column)
    absorbers = [] if vanished else _absorbers(unit, effect, base, output_axis, column)
    others = " and ".join(absorbers) or "the model"
    relation = "zero" if vanished else f"collinear with {others}"
    result = f"{name} is invisible" if vanished else f"{name} is confounded with {others}"
    remedies = _effective_remedies(unit, effect_id, base, axis, absorbers)
    if not remedies:
        always = f"{term} is {relation} in every pose and at every temperature"
        return Cause("", always, result, f"needed: {effect.breaker}")
    feature = " and ".join(r.feature(unit) for r in remedies)
    verb = "makes" if len(remedies) == 1 else "together make"
    return Cause(feature, f"{verb} {term} {relation}", result, " and ".join(r.cure(unit) for r in remedies))


def confounding_feature(state: State, effect_id: str, other: str, base: Sequence[str]) -> str:
    """The feature of a plan that makes one effect similar to another beside a model, as a clause; empty where there is none."""
    state, fitted = first_unit(state), [*base, other]
    try:
        fraction = _remaining_fraction(state, effect_id, fitted, None)
        if fraction <= visibility.SEEN:
            hidden = cause(state, effect_id, fitted)
            return "" if hidden is None else f"{hidden.feature} {hidden.consequence}".strip()
        effect = catalogue.get(effect_id)
        drivers = drivers_of(state, effect) | drivers_of(state, catalogue.get(other))
    except MissingInput:
        return ""
    for remedy in _applicable(state, drivers):
        if _remaining_fraction(remedy.apply(state), effect_id, fitted, None) > _BETTER * fraction:
            output_axis, column, _ = _column(state, effect, None)
            term = factor_text(effect, output_axis, column)
            return f"{remedy.feature(state)} leaves only {100.0 * fraction:.0f} % of {term} independent of {other}"
    return ""


def constant_feature(state: State, drivers: set[Driver]) -> str:
    """The first feature of a plan that keeps one of these quantities constant; empty where there is none."""
    unit = first_unit(state)
    return next((r.feature(unit) for r in _applicable(unit, drivers)), "")


def _applicable(state: State, drivers: set[Driver]) -> list[Remedy]:
    """Remedies for features that the plan has, which vary one of these quantities."""
    return [r for r in REMEDIES if r.driver in drivers and r.feature(state)]


def _missing_quantity(state: State, effect: AnyEffect) -> str:
    """The quantity that an effect needs and the dwells do not carry; empty where they carry all."""
    try:
        values = design.starting_values([effect], state).get(effect.id, {})
        columns_of(state, effect, values, state.axes[0])
    except MissingInput as missing:
        return missing.quantity
    return ""


def _remaining_fraction(state: State, effect_id: str, base: Sequence[str], axis: int | None) -> float:
    """Remaining fraction v of an effect after the base model."""
    seen = visibility.visibilities(state, base, _ERROR, [effect_id])
    if not seen:
        return 0.0
    return seen[0].remaining_fraction if axis is None else seen[0].by_axis[state.axes.index(axis)]


def _column(state: State, effect: AnyEffect, axis: int | None) -> tuple[int, int, bool]:
    """Output axis and column for the sentence, and whether it is zero: a zero column is preferred to a confounded one."""
    values = design.starting_values([effect], state).get(effect.id, {})
    axes = state.axes if axis is None else (axis,)
    fallback = (axes[0], 0, True)
    for output_axis in axes:
        size = np.sqrt(np.mean(columns_of(state, effect, values, output_axis) ** 2, axis=0))
        if size.size and np.all(size < _VANISHED):
            return output_axis, 0, True
        if size.size:
            fallback = (output_axis, int(np.argmax(size)), False)
    return fallback


def _absorbers(state: State, effect: AnyEffect, base: Sequence[str], axis: int, column: int) -> list[str]:
    """The fewest effects of the model, by forward selection, that absorb a column."""
    values = design.starting_values([effect], state).get(effect.id, {})
    target = columns_of(state, effect, values, axis)[:, column]
    norm = float(np.linalg.norm(target))
    parts = {e.id: columns_of(state, e, v, axis) for e, v in _with_values(state, base or _MINIMAL)}
    chosen: list[str] = []
    remainder = norm
    while parts and remainder > _ABSORBED * norm and len(chosen) < 3:
        fitted = [p for n, p in parts.items() if n in chosen]
        remainders = {n: _norm_after(target, [*fitted, p]) for n, p in parts.items() if n not in chosen}
        if not remainders:
            break
        best = min(remainders, key=lambda n: remainders[n])
        if remainders[best] > 0.9 * remainder:
            break
        chosen, remainder = [*chosen, best], remainders[best]
    return chosen


def _with_values(state: State, base: Sequence[str]) -> list[tuple[AnyEffect, dict[str, float]]]:
    effects = catalogue.get_all(base)
    return [(e, design.starting_values([e], state).get(e.id, {})) for e in effects]


def _norm_after(target: Array, parts: Sequence[Array]) -> float:
    """Norm of a column after the least-squares fit of other columns."""
    x = np.concatenate(parts, axis=1)
    size = np.linalg.norm(x, axis=0)
    scaled = x / np.where(size > 0.0, size, 1.0)
    return float(np.linalg.norm(target - scaled @ np.linalg.lstsq(scaled, target, rcond=1e-9)[0]))


def _effective_remedies(
    state: State, effect_id: str, base: Sequence[str], axis: int | None, absorbers: Sequence[str]
) -> list[Remedy]:
    """The fewest remedies that together make an effect visible; none where no remedy helps."""

    def visible(changed: State) -> bool:
        return _remaining_fraction(changed, effect_id, base, axis) >= ENOUGH

    drivers = drivers_of(state, catalogue.get(effect_id)).union(
        *(drivers_of(state, e) for e, _ in _with_values(state, absorbers))
    )
    applicable = _applicable(state, drivers)
    applicable.sort(key=lambda r: r.driver == "force" and drivers != {"force"})
    for remedy in applicable:
        if visible(remedy.apply(state)):
            return [remedy]
    if len(applicable) < 2 or not visible(_with_all(state, applicable)):
        return []
    needed = applicable
    for remedy in applicable:
        fewer = [r for r in needed if r is not remedy]
        if fewer and visible(_with_all(state, fewer)):
            needed = fewer
    return needed


def _with_all(state: State, remedies: Sequence[Remedy]) -> State:
    for remedy in remedies:
        state = remedy.apply(state)
    return state


def symbol(effect: AnyEffect, column: int | None = None) -> str:
    """Symbol of an effect, or of one of its columns where each has its own."""
    each = [part.strip() for part in effect.symbol.split(",")]
    if column is not None and len(each) > column and isinstance(effect, SensorEffect) and len(each) > 1:
        return each[column]
    return ", ".join(each)


def factor_text(effect: AnyEffect, axis: int, column: int) -> str:
    """The factor that one coefficient of an effect multiplies, with the letters of the axes: ``fx·fy``, ``θ²``, ``dT/dt``."""
    if "=" in effect.equation or not isinstance(effect, SensorEffect):
        return f"the column of {effect.id}"
    symbols = [part.strip() for part in effect.symbol.split(",")]
    factors = _factors(re.split(r"[,;] (?![^(]*\))", effect.equation)[0], symbols, column)
    if not factors:
        return f"the column of {effect.id}"
    text = "·".join(factors)
    if text.startswith("(") and text.endswith(")") and len(factors) == 1:
        text = text[1:-1]
    return _lettered(text, axis)


def _factors(terms_text: str, symbols: list[str], column: int) -> list[str]:
    """Factors beside the coefficient in one term of a sum; brackets that contain coefficients are expanded."""
    terms = [t for t in _split(terms_text, "+") if any(s in t for s in symbols)] or [terms_text]
    factors: list[str] = []
    for factor in _split(terms[column] if column < len(terms) else terms[0], "·"):
        if _holds(factor, symbols):
            continue
        opened = factor.startswith("(") and factor.endswith(")") and any(s in factor for s in symbols)
        factors += _factors(factor[1:-1], symbols, column) if opened else [factor]
    return factors


def _split(text: str, sign: str) -> list[str]:
    """Parts of a text, split at a sign outside brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if letter == sign and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [p.strip() for p in parts]


def _holds(factor: str, symbols: list[str]) -> bool:
    """Whether a factor is a coefficient: one of the symbols, alone or with a number."""
    bare = factor.lstrip("½−-").strip()
    return any(re.fullmatch(rf"{re.escape(s)}\w?", bare) for s in symbols)


def _lettered(text: str, axis: int) -> str:
    """The text with the standard's axis indices i, p, o replaced by the letters of the axes."""
    next_axis, other = others(axis)
    letters = {"i": AXES[axis], "p": AXES[next_axis], "j": AXES[next_axis], "o": AXES[other], "k": AXES[other]}
    return re.sub(r"f([ipojk])(?![A-Za-z_])", lambda m: f"f{letters[m.group(1)]}", text)
