"""Restricted deviances by products of columns are those of the whitened series, for every model and any shares of the noise."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_worlds import BASE, Noise, World, make

from inertial import effects as catalogue
from inertial.criticism.examination import ExaminedRun
from inertial.criticism.unknown import suspects
from inertial.data_errors.handling.gain_step import GainStep
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Shares
from inertial.estimation.shares import _deviance_of_block, own_shares, shares_at
from inertial.estimation.term import Term
from pipelines.tables.dwells import lot_of, measured

CUBIC = Term(catalogue.get("third_order"))
SLOW = Term(catalogue.get("aging_linear"))
PLAY = Term(catalogue.get("thermal_hysteresis"), (("half_width", 12.0),), 1, rest=True)
GAIN = Term(GainStep(), (("unit", 1.0), ("dwell", 30.0)))


@cache
def base(*, gaps: bool) -> Model:
    made = make(World(units=3, noise=Noise(white=60.0, flicker=30.0), hidden=(("third_order", 2.0),)), 5_950_001)
    dwells = made.dwells
    if gaps:
        units = sorted(dwells["unit"].unique())
        dwells = dwells[~((dwells["unit"] == units[0]) & dwells["dwell"].isin([5, 17, 18]))]
    return ExaminedRun(lot_of(measured(dwells, made.history), square=False), BASE).model()


def curves(model: Model) -> np.ndarray:
    time = np.linspace(-1.0, 1.0, model.problem.n)
    return np.stack([np.sin(k + 3.0 * time) for k in range(model.problem.blocks)])[..., None]


def of_the_table(model: Model) -> np.ndarray:
    (suspect, *_) = [s for s in suspects(model.problem) if s.candidate.shared]
    return suspect.candidate.of_blocks[:, :, 0]


MODELS = {
    "base": lambda model: model,
    "one more": lambda model: model.with_term(CUBIC),
    "two more": lambda model: model.with_term(PLAY).with_term(CUBIC),
    "three more": lambda model: model.with_term(PLAY).with_term(CUBIC).with_term(SLOW),
    "a curve": lambda model: model.with_curves(curves(model)),
    "more and a curve": lambda model: model.with_term(CUBIC).with_curves(curves(model)),
    "a shared one more": lambda model: model.with_term(GAIN),
    "more and a shared one": lambda model: model.with_term(CUBIC).with_term(GAIN),
    "a shared one and more": lambda model: model.with_term(GAIN).with_term(CUBIC),
    "a shared curve": lambda model: model.with_shared_curves(of_the_table(model)),
    "shared ones alone": lambda model: Model(model.problem, [*model.terms, GAIN, CUBIC], near=model.noise),
}

steps = st.none() | st.integers(-8, 20)
own = st.lists(st.tuples(st.sampled_from([0, 4]), steps, steps), max_size=2, unique_by=lambda one: one[0])


@cache
def model_of(name: str, *, gaps: bool) -> Model:
    return MODELS[name](base(gaps=gaps))


@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize("name", MODELS)
@given(place=st.tuples(steps, steps), apart=own)
@settings(max_examples=12, deadline=None)
def test_a_deviance_by_products_is_that_of_the_whitened_series(
    name: str, place: tuple[int | None, int | None], apart: list[tuple[int, int | None, int | None]], *, gaps: bool
) -> None:
    model = model_of(name, gaps=gaps)
    shares = shares_at(place, tuple((block, *shares_at(each)[:2]) for block, *each in sorted(apart)))
    statistics = model._statistics
    quick = statistics.left(shares, model._weights)
    assert quick is not None
    space = model._rough(shares)
    assert quick.information == pytest.approx(space.information, rel=1e-9)
    np.testing.assert_allclose(quick.squares, space.squares, rtol=1e-7)
    np.testing.assert_allclose(model.problem.covariance.count - statistics.rank, space.by_block)


@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize("name", MODELS)
def test_shares_of_single_blocks_by_products_are_those_of_the_whitened_series(name: str, *, gaps: bool) -> None:
    model = model_of(name, gaps=gaps)
    lot = Shares(1.0, 10.0)
    space = model._rough(lot)
    y = model.problem.y
    series = y - model.shared @ space.shared_sizes if model._joined else y
    quick = model._by_products(lot)
    assert quick(0, Shares(3.0, 0.0)) is not None

    def by_products(block: int, shares: Shares) -> float:
        return quick(block, shares) + model.problem.covariance.whitener_of_block(block, shares).logdet

    def of_series(block: int, shares: Shares) -> float:
        columns = np.concatenate([model.local[block], series[block][:, None]], axis=1)
        return _deviance_of_block(model.problem, block, columns, shares)

    for block in range(model.problem.blocks):
        apart, true = (of(block, Shares(3.0, 1.0)) - of(block, lot) for of in (by_products, of_series))
        assert apart == pytest.approx(true, rel=1e-7, abs=1e-6)
    found = [own_shares(model.problem, series, model.local, space, of) for of in (quick, lambda *_: None)]
    assert found[0] == found[1]


def test_what_is_known_of_equal_models_is_what_each_of_them_finds() -> None:
    model = base(gaps=False)
    there = {shares: model.with_term(PLAY).with_term(CUBIC)._restricted(shares) for shares in map(shares_at, PLACES)}
    other = Model(model.problem, [*model.terms, CUBIC, PLAY])
    for shares, known in there.items():
        space = other._rough(shares)
        plain = other._deviance_of(shares, space.information, space.squares, space.by_block)
        assert other._restricted(shares) == pytest.approx(known, abs=1e-7)
        assert known == pytest.approx(plain, abs=1e-6)


PLACES = [(4, None), (0, 8), (None, 16), (12, 4), (-8, -8)]
