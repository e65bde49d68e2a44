"""Refinement of a term's nonlinear parameters from their grid values to the best fit."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inertial import decisions
from inertial.arrays import Array
from inertial.design import grid_of
from inertial.effects.base import AnyEffect, Nonlinear
from inertial.estimation.alternative import Handling
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise
from inertial.estimation.problem import Problem, Values
from inertial.estimation.space import Gain, Space
from inertial.estimation.term import Term
from inertial.state import ALL_AXES

_NEAR = 3
"""Dwells on either side of a handling error's first dwell that are tried again beside all other terms of the model."""

_CLEARLY = 1.0
"""Chi-square by which another dwell must be better to replace the present one."""


def refine(model: Model, term: Term, noise: Noise) -> Term:
    """The term with its nonlinear parameters at the best fit near their grid values; a handling error at its best dwell.

    One value serves all units and axes, unless a value per axis reduces the residual far more than noise can.
    """
    space = model.at(noise)
    if isinstance(term.effect, Handling):
        return _placed(space, model.problem, term)
    parameters = term.effect.parameters(model.problem.lot.state)
    for parameter in parameters:
        if parameter.every:
            term = _between_choices(space, model.problem, term, parameter)
    continuous = [p for p in parameters if not p.choices]
    for parameter in continuous:
        term = _refine_one(space, model.problem, term, parameter)
    if term.shared or model.problem.lot.radial:
        return term
    for parameter in continuous:
        term = _per_axis(space, model.problem, term, parameter)
    return term


def _placed(space: Space, problem: Problem, term: Term) -> Term:
    """A handling error moved to the best dwell near its present one."""
    if not isinstance(term.effect, Handling):
        return term
    near = term.effect.near(problem.lot, **term.location)
    if len(near) < 2:
        return term
    pieces = list(problem.pieces(term.effect, near))
    drop = np.concatenate([space.gain(replace(p, key=None)).drop for p in pieces])
    return Term(term.effect, tuple(near[int(np.argmax(drop))].items()))


def better_placed(model: Model, term: Term) -> Term | None:
    """A handling error of the model moved to a clearly better dwell nearby; None if there is none."""
    dwell = term.keywords.get("dwell")
    if not isinstance(term.effect, Handling) or not isinstance(dwell, float):
        return None
    rest = model.without_term(term)
    space, n = rest.at(model.noise), model.problem.n
    near = [dwell, *(dwell + k for k in range(-_NEAR, _NEAR + 1) if k and 1 <= dwell + k < n)]
    terms = [Term(term.effect, tuple({**term.keywords, "dwell": k}.items())) for k in near]
    drops = [float(space.gain(replace(t.candidate(rest.problem), key=None)).drop[0]) for t in terms]
    best = int(np.argmax(drops))
    return terms[best] if drops[best] > drops[0] + _CLEARLY else None


def _between_choices(space: Space, problem: Problem, term: Term, parameter: Nonlinear) -> Term:
    """The term with the best value of a discrete parameter between the grid values next to its present one."""
    value = float(np.mean(term.keywords[parameter.name]))
    values = parameter.between(value)
    while values.size:
        step = -(-values.size // _POINTS)
        some = values[::step]
        best = int(np.argmax(_varied(space, problem, term, parameter, some).drop))
        value = float(some[best])
        if step == 1:
            break
        middle = step * best
        values = values[max(middle - step + 1, 0) : middle + step]
    return _with_value(term, parameter, value)


def _refine_one(space: Space, problem: Problem, term: Term, parameter: Nonlinear) -> Term:
    """The term with one parameter refined for all axes: three rounds of five values, each round narrower."""
    centre, width = on_scale(parameter, float(np.mean(term.keywords[parameter.name]))), cell(parameter)
    for _ in range(3):
        values = around(parameter, centre, width)
        gain = _varied(space, problem, term, parameter, values)
        centre, width = on_scale(parameter, float(values[int(np.argmax(gain.drop))])), 0.4 * width
    return _with_value(term, parameter, float(_off_scale(parameter, centre)))


def _per_axis(space: Space, problem: Problem, term: Term, parameter: Nonlinear) -> Term:
    """The term with a value of the parameter for each axis, if the axes differ by more than noise; else as it is."""
    if problem.per_unit < len(ALL_AXES):
        return term
    common = float(_gain(space, problem, term, [term.keywords]).drop[0])
    values = np.repeat(parameter.grid()[:, None], 3, axis=1)
    width, best, taken = cell(parameter), values[0], np.zeros(3)
    for _ in range(4):
        # each set has one value per axis, so that one pass over the columns serves the three axes
        sets = [{**term.keywords, parameter.name: tuple(each)} for each in values.tolist()]
        by_block = _gain(space, problem, term, sets).by_block
        by_axis = by_block.reshape(-1, 3, len(values)).sum(axis=0)
        row = np.argmax(by_axis, axis=1)
        best, taken = values[row, range(3)], by_axis[range(3), row]
        values = np.stack([around(parameter, on_scale(parameter, float(v)), width) for v in best], axis=1)
        width *= 0.4
    if float(taken.sum()) - common < decisions.AXES_DIFFER * space.variance:
        return term
    return _with_value(term, parameter, tuple(best.tolist()))


def on_scale(parameter: Nonlinear, value: float) -> float:
    """A parameter value on the scale (linear, logarithmic or reciprocal) on which it is varied."""
    return {"log": np.log, "inverse": lambda v: 1.0 / v, "linear": lambda v: v}[parameter.scale](value)


def _off_scale(parameter: Nonlinear, value: float) -> float:
    return {"log": np.exp, "inverse": lambda v: 1.0 / v, "linear": lambda v: v}[parameter.scale](value)


def cell(parameter: Nonlinear) -> float:
    """Width of a cell of the starting grid, on its scale."""
    return abs(on_scale(parameter, parameter.high) - on_scale(parameter, parameter.low)) / max(
        parameter.grid().size - 1, 1
    )


def around(parameter: Nonlinear, centre: float, width: float) -> Array:
    """Five values about a centre on the parameter's scale, within its bounds."""
    low, high = sorted((on_scale(parameter, parameter.low), on_scale(parameter, parameter.high)))
    points = np.clip(centre + width * np.array([-0.9, -0.45, 0.0, 0.45, 0.9]), low, high)
    return np.array([_off_scale(parameter, float(p)) for p in points])


def _varied(space: Space, problem: Problem, term: Term, parameter: Nonlinear, values: Array) -> Gain:
    """The gain of a term at several values of one parameter."""
    return _gain(space, problem, term, [{**term.keywords, parameter.name: float(v)} for v in values])


def _gain(space: Space, problem: Problem, term: Term, sets: Sequence[Values]) -> Gain:
    """The gain of a term at several sets of values, with its unknown initial state; large lots are processed in parts."""
    size, start = problem.at_a_time, term.memory and not term.rest
    parts = [sets[first : first + size] for first in range(0, len(sets), size)]
    made = (problem.varied(term.effect, part, first=term.first, start=start) for part in parts)
    return Gain.joined([space.gain(candidate) for candidate in made])


def _with_value(term: Term, parameter: Nonlinear, value: float | tuple[float, ...]) -> Term:
    return replace(term, values=tuple({**term.keywords, parameter.name: value}.items()))


def _beside(model: Model, terms: Sequence[Term], left_out: int) -> Model:
    """A model of all terms but one, at the noise of another model."""
    return Model(model.problem, [t for k, t in enumerate(terms) if k != left_out], near=model.noise)


def terms_of(effects: Sequence[AnyEffect], problem: Problem) -> list[Term]:
    """Terms of a model of given effects, with nonlinear parameters estimated for one effect after the other."""
    terms = [Term(e, tuple(grid_of(e, problem.lot.state)[0].items())) for e in effects]
    for index, effect in enumerate(effects):
        grid = grid_of(effect, problem.lot.state)
        if len(grid) < 2:
            continue
        rest = Model(problem, [t for i, t in enumerate(terms) if i != index])
        gain = rest.space.gain(problem.candidate(effect, grid))
        best = Term(effect, tuple(grid[int(np.argmax(gain.drop))].items()))
        terms[index] = refine(rest, best, rest.noise)
    return terms


def replaced(model: Model) -> Model:
    """The model with the discrete parameters of its effects at their best values beside all other terms.

    While dwells are left out, all instants of a step between their neighbours fit equally well; with the dwells, one is best.
    """
    terms = list(model.terms)
    for index, term in enumerate(model.terms):
        if isinstance(term.effect, Handling):
            continue
        found = [p for p in term.effect.parameters(model.problem.lot.state) if p.choices]
        rest = _beside(model, terms, index)
        for parameter in found:
            drop = _varied(rest.at(model.noise), model.problem, terms[index], parameter, parameter.grid()).drop
            best = _with_value(terms[index], parameter, float(parameter.grid()[int(np.argmax(drop))]))
            terms[index] = _between_choices(rest.at(model.noise), model.problem, best, parameter)
    return Model(model.problem, terms, near=model.noise) if terms != list(model.terms) else model


def settled(model: Model) -> Model:
    """The model with the continuous parameters of its terms at the best fit beside all other terms, at the model's noise.

    A search refines each parameter near its grid, at the larger noise without the term: where the residual depends on the
    parameter weakly, its value would differ between a search and a fit of the resulting model. Parameters with one value per
    axis are not changed.
    """
    terms = list(model.terms)
    for index, original in enumerate(model.terms):
        term = original
        for parameter in _continuous(model.problem, original):
            values, drop = _profile(_beside(model, terms, index).at(model.noise), model.problem, term, parameter)
            term = _with_value(term, parameter, float(values[int(np.argmax(drop))]))
        terms[index] = term
    return Model(model.problem, terms, near=model.noise) if terms != list(model.terms) else model


def intervals(model: Model) -> dict[str, dict[str, tuple[float, float]]]:
    """Profile-likelihood 68 % intervals (low, high), by effect id and name, of the continuous parameters that all axes share.

    Within an interval the sum of squares is less than one noise variance above its minimum; an interval that ends at a bound of
    the parameter is open there.
    """
    by_effect: dict[str, dict[str, tuple[float, float]]] = {}
    for index, term in enumerate(model.terms):
        for parameter in _continuous(model.problem, term):
            space = _beside(model, model.terms, index).at(model.noise)
            values, drop = _profile(space, model.problem, term, parameter)
            inside = values[drop >= drop.max() - space.variance]
            by_parameter = by_effect.setdefault(term.effect.id, {})
            by_parameter[parameter.name] = float(inside.min()), float(inside.max())
    return by_effect


_POINTS = 81
"""Number of values over the range of a parameter at which its profile is computed, and of further values around the best."""


def _profile(space: Space, problem: Problem, term: Term, parameter: Nonlinear) -> tuple[Array, Array]:
    """Values (m,) of a parameter over its range, denser around the best one, and the reduction of χ² (m,) at each."""
    low, high = sorted((on_scale(parameter, parameter.low), on_scale(parameter, parameter.high)))
    fitted = on_scale(parameter, float(np.mean(term.keywords[parameter.name])))
    coarse = np.append(np.linspace(low, high, _POINTS), fitted)

    def drop(scaled: Array) -> Array:
        values = np.array([_off_scale(parameter, float(v)) for v in scaled])
        return _varied(space, problem, term, parameter, values).drop

    first = drop(coarse)
    centre, cell_ = coarse[int(np.argmax(first))], (high - low) / (_POINTS - 1)
    fine = np.clip(np.linspace(centre - cell_, centre + cell_, _POINTS), low, high)
    scaled = np.concatenate([coarse, fine])
    values = np.array([_off_scale(parameter, float(v)) for v in scaled])
    return values, np.concatenate([first, drop(fine)])


def _continuous(problem: Problem, term: Term) -> list[Nonlinear]:
    """The parameters of a term that are continuous and have one value for all axes."""
    if isinstance(term.effect, Handling):
        return []
    parameters = [p for p in term.effect.parameters(problem.lot.state) if not p.choices]
    return [p for p in parameters if isinstance(term.keywords.get(p.name), float)]
