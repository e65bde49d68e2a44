"""A play in stretches is the play point by point; a lot's verdict does not depend on how many columns are worked on at a time."""

import sys
from pathlib import Path

import numpy as np
import pytest
from each import each

from inertial import effects as catalogue
from inertial import operators
from inertial.criticism import adequacy, noise_draws
from inertial.criticism.drivers import drivers_of
from inertial.criticism.field import Candidates
from inertial.criticism.noise_draws import NoiseDraws
from inertial.data_errors.handling.wrong_pose import WrongPose
from inertial.estimation import covariance, model, problem, products, share_statistics, space
from inertial.estimation.lot import Lot
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.term import Term
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


EFFECTS = ("third_order", "odd_quadratic", "adc_nonlinearity", "level_error")


def numbers(lot: Lot) -> list[np.ndarray]:
    """Gains of effects and of every dwell's alternatives, and the probability that noise fits as badly."""
    series = Problem(lot)
    base = Model(series, [Term(catalogue.get(name)) for name in ("bias", "scale", "misalignment")])
    field = Candidates(series, [catalogue.get(name) for name in EFFECTS], [WrongPose()])
    gains = field.gains(base.space, set(), handling=True)
    probability = adequacy.adequacy(field, drivers_of(series), base, np.random.default_rng(1))
    return [np.array(probability), np.array(base.noise.shares[:2]), *(g.drop for _, g in sorted(gains.items()))]


def test_small_pieces_and_empty_stores_change_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    made = make(World(units=2, poses=18, soaks=(25.0,)), 5_510_000)
    lot = lot_of(measured(made.dwells, made.history))
    whole = numbers(lot)
    assert whole[0] > np.log(adequacy.CERTAIN_BELOW)  # then noise is drawn
    for module in (problem, noise_draws, space):
        monkeypatch.setattr(module, "_PIECE", 300)
    for module in (covariance, products, share_statistics):
        monkeypatch.setattr(module, "PIECE", 300)
    monkeypatch.setattr(problem, "_CACHE", 0)
    monkeypatch.setattr(covariance, "_PRODUCTS", 0)
    for module in (share_statistics, noise_draws):
        monkeypatch.setattr(module, "_KEPT", 0)
    monkeypatch.setattr(model, "_SPACES", 0)
    for one, other in zip(numbers(lot), whole, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-8)


def test_draws_worked_on_together_are_those_drawn_one_after_the_other() -> None:
    made = make(World(units=2, poses=18, soaks=(25.0,)), 5_510_000)
    series = Problem(lot_of(measured(made.dwells, made.history)))
    base = Model(series, [Term(catalogue.get(name)) for name in ("bias", "scale", "misalignment")])
    looks = list(Candidates(series, [catalogue.get(name) for name in EFFECTS]).pieces())

    def draws() -> NoiseDraws:
        return NoiseDraws(base, np.random.default_rng(2))

    single = draws()
    apart = np.concatenate([single.worst(looks, 7), single.worst(looks, 7)])
    assert apart.std() > 0.0
    np.testing.assert_allclose(draws().worst(looks, 7, 2), apart, rtol=1e-9)
    kept = draws()
    kept.worst(looks, 7, 2)
    kept.keep(1)
    np.testing.assert_allclose(kept.worst(looks, 7)[0], apart[1], rtol=1e-9)


@each([1, 3, 8, 9, 30])
def test_a_recursion_of_few_signals_is_that_of_many(rows: int, rng: np.random.Generator) -> None:
    keep, drive, start = rng.random(40), rng.normal(size=(rows, 40)), rng.normal(size=rows)
    expected = [start]
    for k in range(drive.shape[1]):
        expected.append(keep[k] * expected[-1] + drive[:, k])
    np.testing.assert_array_equal(operators.recursion(start, keep, drive), np.stack(expected, axis=1))
