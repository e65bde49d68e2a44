"""The residual against the quantity of a missing effect, with what the model with it says: the first picture of a diagnosis."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations_with_replacement, product

import numpy as np

from inertial.arrays import Array, Index
from inertial.criticism.diagnosis import Diagnosis
from inertial.estimation.alternative import Handling
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.term import Term
from inertial.planning.drivers import drivers_of
from inertial.quantities import RECORDED
from pipelines.drawing import Chart, Plot, PlotAxis, Trace
from pipelines.drawing.chart import between, level
from pipelines.report.residuals import DriverValues, added, axes_of, recorded_quantities, residuals_of_model
from pipelines.report.smooth_curve import band
from schemas.units import MICRO

FOLLOWED = 0.8
"""Least part of an effect's contribution that is a function of a quantity, for the effect to be drawn against that quantity."""
FINE = 0.01  # of a range: nearer values count as equal
FEW = 8
MOST_VIEWS = 3
CONTRIBUTION = "the contribution of"  # the quantity of an effect that follows no recorded one
FAN = 40  # units whose curves are drawn
TOO_FINE = 8.0  # residuals so many times smaller are a straight line on the scale of the others
BOTH_SIDES = 2.0  # standard deviations of the band of noise


@dataclass(frozen=True)
class EffectView:
    """The residuals of one axis of a lot against a quantity, µg, (units, n); NaN where a dwell is missing.

    effect : its id; empty where none is missing · quantity : label with its unit · shown : index of the unit that stands out
    x : the quantity · after : with the effect in the model; None where none is missing · curve : what the effect adds
    floor : noise of the measurement, µg rms
    """

    effect: str
    quantity: str
    axis: str
    units: tuple[str, ...]
    shown: int
    x: Array
    before: Array
    after: Array | None
    curve: Array | None
    floor: float

    @property
    def where(self) -> str:
        """Unit and axis for people."""
        return f"{self.units[self.shown]}, {self.axis if self.axis == 'norm' else f'axis {self.axis}'}"

    @property
    def fall(self) -> float:
        """Fall of the mean square of the residuals by the effect, µg²; 0 without a fit with it."""
        return 0.0 if self.after is None else float(np.nanmean(self.before**2) - np.nanmean(self.after**2))

    @property
    def sides(self) -> list[tuple[str, Array]]:
        """The residuals of the unit that stands out, by model."""
        both = [("before", self.before), ("after", self.after)]
        return [(name, values[self.shown]) for name, values in both if values is not None]

    @property
    def title(self) -> str:
        """Title of the picture."""
        depends = (
            f", on which {self.effect} depends" if self.effect and not self.quantity.startswith(CONTRIBUTION) else ""
        )
        return f"Residual against {self.quantity.partition(' / ')[0]}{depends}"

    def largest(self, side: str) -> float:
        """Half of the range of a side's axis, µg."""
        sides = dict(self.sides)
        values = sides[side if self.after is not None and not self.on_one_scale else "before"]
        return 1.08 * max(float(np.nanmax(np.abs(values))), BOTH_SIDES * self.floor, 1e-9)

    @property
    def on_one_scale(self) -> bool:
        """Whether the residuals after can be seen on the scale of those before."""
        sizes = [max(float(np.nanmax(np.abs(values))), BOTH_SIDES * self.floor) for _, values in self.sides]
        return sizes[0] < TOO_FINE * sizes[-1]

    def line(self, unit: int) -> tuple[Array, Array]:
        """The curve of a unit as a line: the mean of what the effect adds at equal values of the quantity."""
        if self.curve is None:
            return np.zeros(0), np.zeros(0)
        x, y = self.x[unit], self.curve[unit]
        there = np.isfinite(x) & np.isfinite(y)
        return _means(x[there], y[there])


def effect_views(diagnosis: Diagnosis, units: tuple[str, ...], held: str = "") -> list[EffectView]:
    """A view of each missing effect, the largest first; without a missing effect, of the residual against what it follows most.

    held : an effect of the judged model, which is seen where none is missing; empty for none
    """
    problem, final = diagnosis.problem, diagnosis.final
    new = set(added(diagnosis)) or {held}
    terms = [term for term in final.terms if term.effect.id in new]
    floor = MICRO * diagnosis.floor
    if not terms:
        residual = residuals_of_model(diagnosis.base, len(units))
        return [_plain(diagnosis, units, residual, floor)]
    after = residuals_of_model(final, len(units))
    views: list[EffectView] = []
    for term in terms:
        without = diagnosis.base
        if len(terms) > 1 or held:  # the other missing effects, at the noise of the model with all
            without = Model(final.problem, final.without_term(term).terms, known=[final.noise])
        before = residuals_of_model(without, len(units))
        views.append(_view(problem, term, units, (before, after), floor))
    return sorted(views, key=lambda view: -view.fall)[:MOST_VIEWS]


def _view(
    problem: Problem, term: Term, units: tuple[str, ...], residuals: tuple[Array, Array], floor: float
) -> EffectView:
    before, after = residuals
    adds = before - after
    fallen = np.nanmean(before**2, axis=2) - np.nanmean(after**2, axis=2)
    shown, axis = (int(k) for k in np.unravel_index(int(np.argmax(fallen)), fallen.shape))
    quantity = next(
        (
            quantity
            for quantity in _quantities(problem, term, axis)
            if followed(quantity.values[shown], adds[shown, axis]) > FOLLOWED
        ),
        DriverValues("", f"{CONTRIBUTION} {term.effect.id} / µg", adds[:, axis]),
    )
    return EffectView(
        term.effect.id, quantity.label, axes_of(problem)[axis], units, shown, quantity.values, before[:, axis],
        after[:, axis], adds[:, axis], floor,
    )  # fmt: skip


def _plain(diagnosis: Diagnosis, units: tuple[str, ...], residual: Array, floor: float) -> EffectView:
    """The largest residuals of an axis against what the residual follows most, else against force along the axis, else time."""
    problem = diagnosis.problem
    sizes = np.nanmean(residual**2, axis=2)
    shown, axis = (int(k) for k in np.unravel_index(int(np.argmax(sizes)), sizes.shape))
    known = {quantity.name: quantity for quantity in recorded_quantities(problem)}
    follows = [
        misfit.driver for misfit in (*([diagnosis.unexplained] if diagnosis.unexplained else []), *diagnosis.where)
    ]
    forces = [] if problem.lot.radial else [_forces(problem, axis)[0]]
    quantity = next(
        (_of_axis(known[name], axis) for name in follows if name in known),
        [*forces, *([known["time_s"]] if "time_s" in known else []), _order(residual)][0],
    )
    curve = None
    if follows and quantity.name in follows:
        curve = np.stack([_smooth(x, y) for x, y in zip(quantity.values, residual[:, axis], strict=True)])
    return EffectView(
        "", quantity.label, axes_of(problem)[axis], units, shown, quantity.values, residual[:, axis], None, curve, floor
    )


def _smooth(x: Array, y: Array) -> Array:
    """A smooth curve through points, at their abscissas; NaN where there are too few."""
    places, low, high = band(x, y)
    return np.interp(x, places, 0.5 * (low + high)) if places.size else np.full(x.shape, np.nan)


def _order(residual: Array) -> DriverValues:
    return DriverValues(
        "dwell", "order of the dwells", np.broadcast_to(np.arange(residual.shape[2], dtype=float), residual[:, 0].shape)
    )


def _of_axis(driver: DriverValues, axis: int) -> DriverValues:
    values = driver.values[..., axis] if driver.values.ndim > 2 else driver.values
    return DriverValues(driver.name, driver.label, values, driver.period)


def _forces(problem: Problem, axis: int) -> list[DriverValues]:
    """The specific force along an axis of the lot, then along the others; (units, n)."""
    along = problem.axes[axis]
    shape = (problem.lot.output.shape[0], problem.n)
    return [
        DriverValues(
            f"f{'xyz'[k]}",
            f"specific force along {'xyz'[k]} / g",
            np.broadcast_to(problem.lot.state.force[..., k], shape),
        )
        for k in (along, *(k for k in range(3) if k != along))
    ]


def _quantities(problem: Problem, term: Term, axis: int) -> Iterator[DriverValues]:
    """What an effect may be a function of: its own quantities, the components of the force, then products of two of these."""
    state, effect = problem.lot.state, term.effect
    known = {quantity.name: _of_axis(quantity, axis) for quantity in recorded_quantities(problem)}
    if isinstance(effect, Handling):
        yield from (known[name] for name in ("time_s",) if name in known)
        return
    columns = {row.attribute: row.column for row in RECORDED}
    names = drivers_of(state, effect)
    quantities = [known[columns[name]] for name in sorted(names) if columns.get(name) in known]
    if not names:  # of a recorded column that the state does not hold
        quantities = [known[effect.id]] if effect.id in known else list(known.values())
    forces = [] if problem.lot.radial or "force" not in names else _forces(problem, axis)
    yield from (*forces, *quantities)
    for first, other in combinations_with_replacement([*forces, *quantities], 2):
        yield DriverValues("", _product(first, other), _about(first) * _about(other))
    for force, other in product(forces, quantities):
        label, _, unit = other.label.partition(" / ")
        square = f"{force.name}·({label} less its mean)² / g·{unit}²"
        yield DriverValues("", square, force.values * _about(other) ** 2)


FORCES = frozenset({"fx", "fy", "fz"})


def _about(driver: DriverValues) -> Array:
    """A component of the force as it is; another quantity about its mean."""
    return driver.values if driver.name in FORCES else driver.values - np.nanmean(driver.values)


def _product(driver: DriverValues, other: DriverValues) -> str:
    parts = [(part.label.partition(" / ")[0], part.label.partition(" / ")[2], part.name) for part in (driver, other)]
    names = [name if name in FORCES else f"({label} less its mean)" for label, _, name in parts]
    if parts[0] == parts[1]:
        return f"{names[0]}² / {parts[0][1]}²"
    units = "g²" if parts[0][1] == parts[1][1] == "g" else "·".join(filter(None, (unit for _, unit, _ in parts)))
    return f"{names[0]}·{names[1]} / {units}"


def followed(x: Array, y: Array) -> float:
    """Part of the squares of values that equal and neighbouring values of ``x`` predict: 1 of a function of x without noise."""
    there = np.isfinite(x) & np.isfinite(y)
    x, y = x[there], y[there]
    if x.size < FEW or np.ptp(x) <= 0.0:
        return 0.0
    group, count = _alike(x)
    at, mean = np.bincount(group, x) / count, np.bincount(group, y) / count
    left = float(np.sum((y - mean[group]) ** 2))
    if count.size >= FEW:  # between fewer values, such as those of soaks, a function may turn
        share = (at[1:-1] - at[:-2]) / (at[2:] - at[:-2])
        left += float(count[1:-1] @ (mean[1:-1] - (1.0 - share) * mean[:-2] - share * mean[2:]) ** 2)
    return 1.0 - left / max(float(y @ y), 1e-300)


def _alike(x: Array) -> tuple[Index, Array]:
    """For each value the number of its group of nearly equal values, ascending; and the size of each group."""
    order = np.argsort(x)
    group = np.empty(x.size, dtype=np.intp)
    group[order] = np.concatenate([[0], np.cumsum(np.diff(x[order]) > FINE * np.ptp(x))])
    return group, np.bincount(group).astype(float)


def _means(x: Array, y: Array) -> tuple[Array, Array]:
    """The mean of values with nearly equal x, in order of x."""
    if not x.size:
        return x, y
    group, count = _alike(x)
    return np.bincount(group, x) / count, np.bincount(group, y) / count


def effect_chart(view: EffectView, pick: Callable[[int, int], str] | None = None) -> Chart:
    """Before and after: the points of a unit, the model's curve through them, and a fan of the curves of the other units.

    pick : selection by a click on the point of a dwell, from the indices of its unit and of itself
    """
    picks = () if pick is None else tuple(pick(view.shown, k) for k in range(view.x.shape[1]))
    x, noise = view.x[view.shown], BOTH_SIDES * view.floor
    plots: list[Plot] = []
    for name, residual in view.sides:
        traces = [between(x, -noise, noise, "noise, ± 2σ"), level(x, 0.0, dashed=False)]
        if name == "before":
            others = [view.line(k) for k in range(len(view.units)) if k != view.shown][:FAN]
            traces += [
                Trace("the same, other units", *line, "line", "muted", width=1.0, legend=not k)
                for k, line in enumerate(others)
            ]
        role = "before" if name == "before" else "after"
        traces.append(
            Trace(f"residual {name}" if view.effect else "residual", x, residual, role=role, size=6.0, picks=picks)
        )
        if name == "before" and view.curve is not None:
            label = f"model with {view.effect}" if view.effect else "smooth curve"
            traces.append(Trace(label, *view.line(view.shown), "line", "ink", width=2.4))
        largest = view.largest(name)
        title = f"{name}, {view.where}{'' if name == 'before' or view.on_one_scale else ' (finer scale)'}"
        across = PlotAxis("residual / µg", low=-largest, high=largest)
        there = tuple(trace for trace in traces if trace.x.size)
        plots.append(Plot(title if view.effect else view.where, PlotAxis(view.quantity), across, there))
    return Chart(view.title, tuple(plots), len(plots), height=330)
