"""A model with one more term is kept by the term's values: what is asked of it with an equal term is what was asked first."""

import pandas as pd
import pytest
from made_worlds import Noise, World, make

from inertial import effects as catalogue
from inertial.criticism.examination import ExaminedRun
from inertial.data_errors.handling.gain_step import GainStep
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Shares
from inertial.estimation.term import Term
from pipelines.tables.dwells import lot_of, measured

MODEL = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
PPM = 500.0
FROM = 36


def dwells_with_a_gain_step(units: int, seed: int) -> tuple[pd.DataFrame, pd.DataFrame, str]:
    """A lot whose last unit reads by :data:`PPM` more from the dwell half-way on; its temperatures; the unit."""
    made = make(World(units=units, noise=Noise(white=25.0, flicker=30.0)), 5_700_000 + seed)
    dwells = made.dwells.copy()
    unit = max(dwells["unit"].unique())
    later = (dwells["unit"] == unit) & (dwells["dwell"] >= FROM)
    assert 0.3 < later.sum() / (dwells["unit"] == unit).sum() < 0.7
    dwells.loc[later, ["out_x", "out_y", "out_z"]] *= 1.0 + 1e-6 * PPM
    return dwells, made.history, unit


def model_and_term() -> tuple[Model, Term]:
    dwells, history, _ = dwells_with_a_gain_step(2, 23)
    base = ExaminedRun(lot_of(measured(dwells, history), square=False), MODEL).model()
    return base, Term(GainStep(), (("unit", 1.0), ("dwell", float(FROM))))


def equal(term: Term) -> Term:
    return Term(GainStep(), tuple(dict(term.values).items()))


def test_the_size_of_an_equal_term_is_its_size() -> None:
    base, term = model_and_term()
    first = base.with_term(term)
    again = base.with_term(equal(term))
    assert again is first
    assert 1e6 * again.shared_sizes(equal(term)) == pytest.approx([PPM], rel=0.2)
    with pytest.raises(KeyError, match="gain_step: not a term of the model"):
        base.shared_sizes(term)


def test_a_model_less_an_equal_term_does_not_hold_it() -> None:
    base, term = model_and_term()
    richer = base.with_term(term)
    assert [t.effect.id for t in richer.without_term(equal(term)).terms] == [t.effect.id for t in base.terms]


@pytest.mark.parametrize("shares", [Shares(1.0, 0.0), Shares(3.0, 10.0), Shares(0.1, 100.0)])
def test_terms_that_are_added_in_turn_leave_what_they_leave_together(shares: Shares) -> None:
    base, _ = model_and_term()
    terms = [Term(catalogue.get(name)) for name in ("third_order", "aging_linear", "second_order")]
    in_turn = base
    for place, term in enumerate(terms):
        in_turn = in_turn.with_term(term)
        together = Model(base.problem, [*base.terms, *terms[: place + 1]])
        assert in_turn._restricted(shares) == pytest.approx(together._restricted(shares), abs=1e-6)
