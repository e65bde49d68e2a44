"""Scores of a run in a file: how near they are to those that were put in."""

from dataclasses import replace

import numpy as np
import pytest

from inertial.arrays import Array
from inertial.discovery.scores import LotScores, Products
from pipelines.discovery.score_store import content_of, run_of, written
from pipelines.discovery.scored_run import ScoredRun

UNITS, K = 4, 5


def made(run: str, size: float, rng: np.random.Generator) -> ScoredRun:
    own = np.exp(rng.uniform(20.0, 40.0, 3 * K)) * rng.uniform(0.6, 1.6, (UNITS, 1))
    own[:, 2] = 0.0
    z: Array = size * rng.standard_normal(own.shape)
    columns, inside = tuple((f"effect{k}", 0) for k in range(K)), np.tile(np.eye(K), (3, 1, 1))
    scores = LotScores(
        Products(columns, (("level", 0),), np.eye(3 * K), inside, np.ones(3 * K)), z * np.sqrt(own), own,
        own.sum(axis=0) * rng.uniform(0.06, 1.0, 3 * K), np.ones((2, 1)), 40e-6 * rng.standard_normal((UNITS, 3)), 1e-5,
    )  # fmt: skip
    head = run, "2026-03-02T10:00:00+00:00", "line-1", "DEMO", "bias,scale", "", ""
    return ScoredRun(*head, tuple("abcd"), tuple("1234"), (2**62, -5, 0, 7), scores)


@pytest.mark.parametrize("size", [1.0, 30.0, 1e5])
def test_scores_keep_a_thirtieth_of_their_standard_deviation_and_information_a_hundredth(size: float) -> None:
    rng = np.random.default_rng(6)
    runs = [made(f"r{k}", size, rng) for k in range(5)]
    table, products = content_of(written(runs))
    for row, run in zip(table.to_pylist(), runs, strict=True):
        again = run_of(row, products)
        before, after = run.scores, again.scores
        seen = before.own > 0.0
        root = np.sqrt(np.where(seen, before.own, 1.0))
        exact, near = before.score / root, after.score / root
        assert np.all(np.abs(near - exact)[seen] <= 1.0 / 28.0 + 0.006 * np.abs(exact)[seen])
        assert after.own == pytest.approx(before.own, rel=0.01)
        assert after.information == pytest.approx(before.information, rel=0.012)
        assert after.tempco == pytest.approx(before.tempco, rel=1e-3)
        assert (again.units, again.prints, after.products.columns) == (run.units, run.prints, before.products.columns)
        assert (after.products.station, after.products.lots) == (before.products.station, len(runs))


def test_products_of_columns_are_correlations_within_and_between_axes() -> None:
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((40, 3 * K)) + rng.standard_normal((40, 1))
    lot = columns.T @ columns
    inside = np.stack([columns[:, at : at + K].T @ columns[:, at : at + K] for at in range(0, 3 * K, K)])
    run = made("r0", 1.0, rng)
    scores = replace(run.scores, products=replace(run.scores.products, lot=lot, inside=inside))
    (product,) = content_of(written([replace(run, scores=scores)]))[1].values()
    exact = lot / np.sqrt(np.outer(np.diagonal(lot), np.diagonal(lot)))
    assert product.lot == pytest.approx(exact, abs=1.0 / 256.0)
    for axis in range(3):
        here = slice(axis * K, (axis + 1) * K)
        assert product.lot[here, here] == pytest.approx(exact[here, here], abs=1.0 / 2048.0)
        assert product.inside[axis] == pytest.approx(exact[here, here], abs=1.0 / 2048.0)
    both = Products.mean([product, replace(product, lot=0.0 * product.lot, lots=3)])
    assert (both.lots, both.lot) == (4, pytest.approx(0.25 * product.lot))
