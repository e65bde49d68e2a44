"""Dwells left out, all blocks at once: the prediction and its density are those of the covariance of every block by itself."""

import sys
from pathlib import Path

import numpy as np
import pytest

from inertial import effects as catalogue
from inertial.criticism.bad_dwells import BadDwell, without
from inertial.criticism.left_out import left_out
from inertial.criticism.model import Model
from inertial.criticism.problem import Problem
from inertial.criticism.refinement import terms_of
from pipelines.tables.dwells import lot_of, measured

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from world import World, make

BASE = ["bias", "scale", "misalignment"]


def model(effects: list[str]) -> Model:
    """A model of three units, two dwells of which are missing."""
    lot = lot_of(measured(make(World(units=3, poses=10), 20_261_122).dwells))
    lot = without(lot, [BadDwell(1, k, np.zeros(3), np.zeros(3)) for k in (2, 9)])
    problem = Problem(lot)
    return Model(problem, terms_of(catalogue.get_all(effects), problem))


def by_definition(of: Model, out: np.ndarray) -> tuple[np.ndarray, float]:
    """Deviations (blocks, k) of dwells ``out``, and their log density, by a dense covariance of all blocks together."""
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
    p = precision - precision @ h @ np.linalg.pinv(h.T @ precision @ h, rcond=1e-12) @ h.T @ precision
    places = np.flatnonzero((out & there).reshape(-1))
    inner = p[np.ix_(places, places)]
    right = (p @ of.problem.y.reshape(-1))[places]
    missed = np.full(blocks * n, np.nan)
    missed[places] = np.linalg.solve(inner, right)
    density = 0.5 * np.linalg.slogdet(inner)[1] - 0.5 * places.size * np.log(2.0 * np.pi) - 0.5 * right @ missed[places]
    return missed.reshape(blocks, n)[:, out], float(density)


@pytest.mark.parametrize("effects", [BASE, [*BASE, "level_error"]])
def test_dwells_left_out_are_predicted_as_by_the_covariance_of_all_blocks(effects: list[str]) -> None:
    of = model(effects)
    found = left_out(of)
    n = of.problem.n
    stretch = np.empty(n, dtype=np.intp)
    stretch[np.argsort(of.problem.lot.state.time[0], kind="stable")] = np.arange(n) * 6 // n
    total = 0.0
    for k in range(6):
        missed, density = by_definition(of, stretch == k)
        np.testing.assert_allclose(found.missed["blocks of time"][:, stretch == k], missed, rtol=1e-5, atol=1e-11)
        total += density
    assert found.density["blocks of time"] == pytest.approx(total, rel=1e-8)
