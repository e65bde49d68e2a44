"""A model with one more term is kept by the term's values: what is asked of it with an equal term is what was asked first."""

import pytest
from made_worlds import BASE, Noise, World, make

from inertial import effects as catalogue
from inertial.criticism.examination import ExaminedRun
from inertial.data_errors.handling.gain_step import GainStep
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Shares
from inertial.estimation.term import Term
from pipelines.tables.dwells import lot_of, measured

TERM, EQUAL = (Term(GainStep(), (("unit", 1.0), ("dwell", 36.0))) for _ in range(2))


def base_model() -> Model:
    """Of a lot whose last unit reads 500 ppm more from the dwell half-way on."""
    made = make(World(units=2, noise=Noise(white=25.0, flicker=30.0)), 5_700_023)
    later = (made.dwells["unit"] == made.dwells["unit"].max()) & (made.dwells["dwell"] >= 36)
    made.dwells.loc[later, ["out_x", "out_y", "out_z"]] *= 1.0 + 500e-6
    return ExaminedRun(lot_of(measured(made.dwells, made.history), square=False), BASE).model()


def test_a_model_with_an_equal_term_is_the_same_and_less_it_does_not_hold_it() -> None:
    base = base_model()
    richer = base.with_term(TERM)
    assert base.with_term(EQUAL) is richer
    assert 1e6 * richer.shared_sizes(EQUAL) == pytest.approx([500.0], rel=0.2)
    assert [t.effect.id for t in richer.without_term(EQUAL).terms] == [t.effect.id for t in base.terms]
    with pytest.raises(KeyError, match="gain_step: not a term of the model"):
        base.shared_sizes(TERM)


@pytest.mark.parametrize("shares", [Shares(1.0, 0.0), Shares(3.0, 10.0), Shares(0.1, 100.0)])
def test_terms_that_are_added_in_turn_leave_what_they_leave_together(shares: Shares) -> None:
    base = base_model()
    terms = [Term(catalogue.get(name)) for name in ("third_order", "aging_linear", "second_order")]
    in_turn = base
    for place, term in enumerate(terms):
        in_turn = in_turn.with_term(term)
        together = Model(base.problem, [*base.terms, *terms[: place + 1]])
        assert in_turn._restricted(shares) == pytest.approx(together._restricted(shares), abs=1e-6)
