"""A lot's verdict does not depend on how many columns or draws are worked on at a time."""

import numpy as np
import pytest
from made_worlds import World, lot_in, make

from inertial import effects as catalogue
from inertial.criticism import adequacy, noise_draws
from inertial.criticism.drivers import drivers_of
from inertial.criticism.field import Candidates
from inertial.criticism.noise_draws import NoiseDraws
from inertial.data_errors.handling import alternatives
from inertial.estimation import covariance, problem, share_statistics, space
from inertial.estimation.lot import Lot
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.term import Term

EFFECTS = ("third_order", "odd_quadratic", "adc_nonlinearity", "level_error")


@pytest.fixture(scope="module")
def lot() -> Lot:
    return lot_in(make(World(units=2, poses=18, soaks=(25.0,)), 5_510_000))


def model_of(lot: Lot) -> Model:
    return Model(Problem(lot), [Term(catalogue.get(name)) for name in ("bias", "scale", "misalignment")])


def numbers(lot: Lot) -> list[np.ndarray]:
    """Gains of effects and of every place of an alternative, and the probability that noise fits as badly."""
    base = model_of(lot)
    field = Candidates(base.problem, [catalogue.get(name) for name in EFFECTS], alternatives())
    (gains,) = field.gains([base.space], set(), handling=True)
    assert len(gains) > 4 + len(EFFECTS)
    probability = adequacy.adequacy(field, drivers_of(base.problem), base, np.random.default_rng(1))
    return [np.array(probability), np.array(base.noise.shares[:2]), *(g.drop for _, g in sorted(gains.items()))]


def test_small_pieces_and_empty_stores_change_no_number(lot: Lot, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = numbers(lot)
    assert whole[0] > np.log(adequacy.CERTAIN_BELOW)  # then noise is drawn
    for names, modules, value in (
        ("_PIECE", (problem, noise_draws, space), 300), ("PIECE", (covariance, share_statistics), 300),
        ("_CACHE", (problem,), 0), ("_PRODUCTS", (covariance,), 0), ("_KEPT", (noise_draws,), 0),
    ):  # fmt: skip
        for module in modules:
            monkeypatch.setattr(module, names, value)
    for one, other in zip(numbers(lot), whole, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-8 * max(float(np.max(np.abs(other))), 1.0))


def test_draws_worked_on_together_are_those_drawn_one_after_the_other(lot: Lot) -> None:
    base = model_of(lot)
    looks = list(Candidates(base.problem, [catalogue.get(name) for name in EFFECTS]).pieces())

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
