"""A play in stretches is the play point by point; a lot's verdict does not depend on how many columns are worked on at a time."""

import sys
from pathlib import Path

import numpy as np
import pytest

from inertial import operators
from inertial.criticism import adequacy, covariance, model, problem
from inertial.criticism.diagnosis import Diagnosis, diagnose
from pipelines.tables.dwells import lot_of, measured

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from world import World, make


def point_by_point(signal: np.ndarray, half_width: float, start: float) -> np.ndarray:
    """The definition: every step moves the position, which stays within −1 … 1."""
    out = np.empty(signal.shape)
    out[..., 0] = start
    for k, change in enumerate(np.moveaxis(np.diff(signal, axis=-1), -1, 0)):
        out[..., k + 1] = np.clip(out[..., k] + change / half_width, -1.0, 1.0)
    return out


@pytest.mark.parametrize("shape", [(1,), (2,), (7,), (3, 1), (3, 101), (2, 3, 50), (65, 400)])
@pytest.mark.parametrize("half_width", [0.3, 5.0, 1000.0])
def test_a_play_is_its_definition_point_by_point(shape: tuple[int, ...], half_width: float) -> None:
    signal = np.cumsum(np.random.default_rng(20_261_150).standard_normal(shape), axis=-1)
    for start in (-1.0, 0.0, 0.3, 1.0):
        expected = point_by_point(signal, half_width, start)
        np.testing.assert_allclose(operators.play(signal, half_width, start), expected, atol=1e-12)
    memory = 0.5 * (point_by_point(signal, half_width, 1.0) - point_by_point(signal, half_width, -1.0))
    np.testing.assert_allclose(operators.play_memory(signal, half_width), memory, atol=1e-12)


def numbers(found: Diagnosis) -> list[float]:
    """Every number of the search: the probability, and score and drop of all rivals."""
    return [found.log_p, found.floor, *(v for r in found.ladder for v in (r.cost, r.drop))]


def test_small_pieces_and_empty_stores_change_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    made = make(World(units=2, poses=18, soaks=(25.0,), hidden=(("third_order", 3.0),)), 5_510_000)
    effects = ("bias", "scale", "misalignment")
    whole = diagnose(lot_of(measured(made.dwells, made.history)), effects, np.random.default_rng(1))
    monkeypatch.setattr(problem, "_PIECE", 5_000)
    monkeypatch.setattr(problem, "_CACHE", 0)
    monkeypatch.setattr(covariance, "_COLUMNS", 0)
    monkeypatch.setattr(adequacy, "_PIECE", 500)
    monkeypatch.setattr(model, "_SPACES", 0)
    pieces = diagnose(lot_of(measured(made.dwells, made.history)), effects, np.random.default_rng(1))
    assert [n.effects.ids for n in pieces.named] == [n.effects.ids for n in whole.named]
    assert whole.named
    np.testing.assert_allclose(numbers(pieces), numbers(whole), rtol=1e-6)
