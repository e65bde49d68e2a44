"""Scores of a run in a file: how near they are to those that were put in."""

import io
from dataclasses import replace

import numpy as np
import pytest

from inertial.arrays import Array
from pipelines.discovery.score_store import _content, _names, _run_of, _unfolded, written
from pipelines.discovery.scored_run import ScoredRun

UNITS, K = 4, 5


def made(run: str, size: float, rng: np.random.Generator) -> ScoredRun:
    own = np.exp(rng.uniform(20.0, 40.0, 3 * K)) * rng.uniform(0.6, 1.6, (UNITS, 1))
    own[:, 2] = 0.0
    z: Array = size * rng.standard_normal(own.shape)
    products = np.tile(np.eye(K), (3, 1, 1))
    return ScoredRun(
        run, "2026-03-02T10:00:00+00:00", "line-1", "DEMO", "bias,scale", "", "", tuple("abcd"), tuple("1234"),
        tuple((f"effect{k}", 0) for k in range(K)), (("level", 0),), z * np.sqrt(own), own,
        own.sum(axis=0) * rng.uniform(0.06, 1.0, 3 * K), np.ones((2, 1)), np.eye(3 * K), products, np.ones(3 * K),
        40e-6 * rng.standard_normal((UNITS, 3)), 1e-5,
    )  # fmt: skip


@pytest.mark.parametrize("size", [1.0, 30.0, 1e5])
def test_scores_keep_a_thirtieth_of_their_standard_deviation_and_information_a_hundredth(size: float) -> None:
    rng = np.random.default_rng(6)
    runs = [made(f"r{k}", size, rng) for k in range(5)]
    content = _content(written(runs))
    assert content is not None
    for row, run in zip(content.table.to_pylist(), runs, strict=True):
        kept = _run_of(row, _names(content.about))
        assert run.own is not None
        seen = run.own > 0.0
        root = np.sqrt(np.where(seen, run.own, 1.0))
        exact, near = run.score / root, kept.score / root
        assert np.all(np.abs(near - exact)[seen] <= 1.0 / 28.0 + 0.006 * np.abs(exact)[seen])
        assert kept.own == pytest.approx(run.own, rel=0.01)
        assert kept.information == pytest.approx(run.information, rel=0.012)
        assert kept.tempco == pytest.approx(run.tempco, rel=1e-3)
        assert (kept.units, kept.columns, kept.of_station) == (run.units, run.columns, run.of_station)


def test_products_of_columns_are_correlations_within_and_between_axes() -> None:
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((40, 3 * K)) + rng.standard_normal((40, 1))
    lot = columns.T @ columns
    inside = np.stack([columns[:, at : at + K].T @ columns[:, at : at + K] for at in range(0, 3 * K, K)])
    run = made("r0", 1.0, rng)
    content = _content(written([replace(run, lot=lot, inside=inside)]))
    assert content is not None
    with np.load(io.BytesIO(content.products), allow_pickle=False) as arrays:
        ((name, (of_sensor, of_station, runs)),) = _names(content.about).items()
        product = _unfolded(name, of_sensor, of_station, runs, arrays)
    exact = lot / np.sqrt(np.outer(np.diagonal(lot), np.diagonal(lot)))
    assert product.lot == pytest.approx(exact, abs=1.0 / 256.0)
    for axis in range(3):
        here = slice(axis * K, (axis + 1) * K)
        assert product.lot[here, here] == pytest.approx(exact[here, here], abs=1.0 / 2048.0)
        assert product.inside[axis] == pytest.approx(exact[here, here], abs=1.0 / 2048.0)
    doubled = product.with_more(replace(product, lot=0.0 * product.lot, runs=3))
    assert (doubled.runs, doubled.lot) == (4, pytest.approx(0.25 * product.lot))
