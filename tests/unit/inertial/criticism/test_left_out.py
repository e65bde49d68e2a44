"""Dwells left out, all blocks at once: the prediction and its density are those of the covariance of every block by itself."""

import numpy as np
import pytest
from each import each
from made_worlds import World, make

from inertial import effects as catalogue
from inertial.criticism.left_out import left_out
from inertial.data_errors.handling.table_slip import TableSlip
from inertial.data_errors.handling.unit_moved import UnitMoved
from inertial.data_errors.removed_dwells import without
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import terms_of
from inertial.estimation.term import Term
from pipelines.tables.dwells import lot_of, measured

BASE = ["bias", "scale", "misalignment"]
SLIP = Term(TableSlip(), (("dwell", 17.0),))
MOVED = Term(UnitMoved(), (("unit", 1.0), ("dwell", 4.0)))


def model(effects: list[str], *handling: Term) -> Model:
    """A model of three units, two dwells of which are missing."""
    lot = lot_of(measured(make(World(units=3, poses=10), 20_261_122).dwells))
    problem = Problem(without(lot, [(1, 2), (1, 9)]))
    return Model(problem, [*terms_of(catalogue.get_all(effects), problem), *handling])


def stretches(of: Model) -> np.ndarray:
    """The stretch of time of each dwell, (n,)."""
    n = of.problem.n
    stretch = np.empty(n, dtype=np.intp)
    stretch[np.argsort(of.problem.lot.state.time[0], kind="stable")] = np.arange(n) * 6 // n
    return stretch


def by_definition(of: Model, out: np.ndarray, kept: int = 0) -> tuple[np.ndarray, float]:
    """Deviations (blocks, k) of dwells ``out``, and their log density, by a dense covariance of all blocks together.

    kept : number of shared columns, the last ones, that keep the coefficients of all dwells
    """
    space, blocks, n = of.space, of.problem.blocks, of.problem.n
    there = space.covariance.there
    precision = np.zeros((blocks * n, blocks * n))
    for members, whitener in space.covariance.whiteners(space.noise.shares):
        for b in members.tolist():
            level = float(space.covariance.level[b] * space.noise.scale[b])
            precision[b * n : (b + 1) * n, b * n : (b + 1) * n] = whitener.T @ whitener / level**2
    columns = np.zeros((blocks, n, blocks, of.local.shape[-1]))
    for b in range(blocks):
        columns[b, :, b] = of.local[b]
    h = np.concatenate([columns.reshape(blocks * n, -1), of.shared.reshape(blocks * n, -1)], axis=1)
    h = h / np.where((size := np.linalg.norm(h, axis=0)) > 0.0, size, 1.0)
    y = of.problem.y.reshape(-1)
    if kept:
        every = np.linalg.pinv(h.T @ precision @ h, rcond=1e-12) @ (h.T @ precision @ y)
        y, h = y - h[:, -kept:] @ every[-kept:], h[:, :-kept]
    p = precision - precision @ h @ np.linalg.pinv(h.T @ precision @ h, rcond=1e-12) @ h.T @ precision
    places = np.flatnonzero((out & there).reshape(-1))
    inner = p[np.ix_(places, places)]
    right = (p @ y)[places]
    missed = np.full(blocks * n, np.nan)
    missed[places] = np.linalg.solve(inner, right)
    density = 0.5 * np.linalg.slogdet(inner)[1] - 0.5 * places.size * np.log(2.0 * np.pi) - 0.5 * right @ missed[places]
    return missed.reshape(blocks, n)[:, out], float(density)


LEVEL = [*BASE, "level_error"]


@each([(BASE, (), 0), (LEVEL, (), 0), (BASE, (SLIP,), 2), (LEVEL, (SLIP, MOVED), 5)])
def test_dwells_left_out_are_predicted_as_by_the_covariance_of_all_blocks(row):
    effects, handling, kept = row
    of, total = model(effects, *handling), 0.0
    found, stretch = left_out(of), stretches(of)
    for k in range(6):
        missed, density = by_definition(of, stretch == k, kept)
        np.testing.assert_allclose(found.missed["blocks of time"][:, stretch == k], missed, rtol=1e-5, atol=1e-11)
        total += density
    assert found.density["blocks of time"] == pytest.approx(total, rel=1e-8)


def test_a_handling_error_is_judged_by_the_other_dwells_alone_and_by_no_number_where_they_do_not_determine_it() -> None:
    of = model(BASE, SLIP)
    found, stretch = left_out(of, SLIP), stretches(of)
    for k in range(6):
        missed, _ = by_definition(of, stretch == k)
        np.testing.assert_allclose(found.missed["blocks of time"][:, stretch == k], missed, rtol=1e-5, atol=1e-11)
    # the unit moved before the fifth of thirty dwells: without the first stretch nothing is left of the side before
    of = model(BASE, MOVED)
    found = left_out(of, MOVED)
    assert ("poses" in found.density, "blocks of time" in found.density) == (True, False)
    assert "blocks of time" in left_out(of).density
