"""A lot's verdict does not depend on how many columns or draws are worked on at a time."""

import numpy as np
import pytest
from made_worlds import World, lot_in, make, problem_in

from inertial import effects as catalogue
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
    lot = lot_in(made)
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
    series = problem_in(made)
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
