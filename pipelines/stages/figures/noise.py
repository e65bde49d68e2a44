"""Figures of the static record: noise terms of the worst axis (IEEE Std 952), and the stability of the bias over an hour."""

from collections.abc import Callable

import numpy as np

from inertial.distributions import NORMAL_95
from inertial.uncertainty.degrees import dof_of_upper
from pipelines.stages.figures.base import FigureKind, UnitTables, Value
from pipelines.stages.noise import B_BOUND, HOUR_S, TERM
from pipelines.tables.frames import UnitRows
from schemas.recipe import Recipe


def _worst_axis(term: str) -> Callable[[UnitTables], Value | None]:
    """A noise term of the worst axis; a term that is not identified counts with its upper limit.

    A unit with a silent axis has no figure: a value that was not measured is not within a limit. There is none of the stability
    over an hour where the record is shorter.
    """

    def value(tables: UnitTables) -> Value | None:
        rows = tables.noise
        if not len(rows) or (term == TERM and term not in set(rows["term"].tolist())):
            return None
        by_axis = [_noise_term(row, rows) for row in np.flatnonzero(rows["term"] == term).tolist()]
        return max(by_axis, key=lambda figure: figure.reach(tables.guard))

    return value


def _noise_term(row: int, rows: UnitRows) -> Value:
    value, low, high = (float(rows[column][row]) for column in ("value", "low", "high"))
    axis = rows["axis"][row]
    if rows["identified"][row]:
        return Value(value, (high - low) / (2.0 * NORMAL_95), dof=dof_of_upper(high / value) if value > 0.0 else np.nan)
    if rows["term"][row] == "B":  # two upper bounds: the smaller holds
        bound = rows["high"][(rows["term"] == B_BOUND) & (rows["axis"] == axis)]
        high = float(np.fmin(high, bound[0]))
    if not np.isfinite(high):
        why = str(rows["note"][row]) if "note" in rows else "no upper limit"
        return Value(np.inf, 0.0, f"axis {axis}: {why}")
    return Value(high, 0.0)


def _static_record(recipe: Recipe) -> str:
    return "" if recipe.static_record_s > 0.0 else "a static record (static_record_s > 0)"


def _an_hour(recipe: Recipe) -> str:
    return "" if recipe.static_record_s >= HOUR_S else f"a static record of an hour (static_record_s >= {HOUR_S:g})"


FIGURES = (
    FigureKind(
        name="velocity_random_walk_ug_rtHz",
        unit="µg/√Hz",
        meaning="Velocity random walk N of the worst axis, two-sided as in IEEE Std 952.",
        label="velocity random walk N, worst axis",
        order=100,
        value=_worst_axis("N"),
        missing=_static_record,
    ),
    FigureKind(
        name="bias_instability_ug",
        unit="µg",
        meaning="Bias instability B of the worst axis (IEEE Std 952).",
        label="bias instability B, worst axis",
        order=110,
        value=_worst_axis("B"),
        missing=_static_record,
    ),
    FigureKind(
        name="bias_stability_1h_ug",
        unit="µg",
        meaning="Bias stability over one hour: standard deviation of 100 s means in the last hour of the static record, worst "
        "axis.",
        label="bias stability over 1 h, standard deviation of 100 s means, worst axis",
        order=112,
        value=_worst_axis(TERM),
        missing=_an_hour,
    ),
    FigureKind(
        name="rate_random_walk_ug_rts",
        unit="µg/√s",
        meaning="Rate random walk K of the worst axis (IEEE Std 952).",
        label="acceleration random walk K, worst axis",
        order=120,
        value=_worst_axis("K"),
        missing=_static_record,
    ),
)
