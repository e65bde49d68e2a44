"""Formulas of model files: what they may say, what they mean, what is refused."""

import numpy as np
import pytest
from each import each

from inertial.effects.formula import Formula
from inertial.expressions import Expression, FormulaInvalid, UnknownName
from inertial.state import State


@pytest.fixture
def state(rng: np.random.Generator) -> State:
    n = 12
    return State(
        force=rng.standard_normal((2, n, 3)), time=np.tile(3600.0 * np.arange(n), (2, 1)),
        temperature=25.0 + rng.standard_normal((2, n)),
        covariates={"humidity_pct": rng.uniform(30.0, 60.0, (2, n))},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "means"),
    [
        ("f", lambda s, a: s.force[..., a]),
        ("fj * fk", lambda s, a: s.force[..., (a + 1) % 3] * s.force[..., (a + 2) % 3]),
        ("-theta**2 / 4", lambda s, _: -(s.theta**2) / 4),
        ("humidity_pct * f", lambda s, a: s.covariates["humidity_pct"] * s.force[..., a]),
        ("sqrt(abs(f)) + exp(-hours)", lambda s, a: np.sqrt(np.abs(s.force[..., a])) + np.exp(-s.time / 3600.0)),
        ("maximum(temperature, unit_C) * sign(f)", lambda s, a: s.temperature * np.sign(s.force[..., a])),
        ("tanh(minimum(f, 1e-3)) + sin(f) * cos(f) + log(humidity_pct)",
         lambda s, a: np.tanh(np.minimum(s.force[..., a], 1e-3)) + np.sin(s.force[..., a]) * np.cos(s.force[..., a])
         + np.log(s.covariates["humidity_pct"])),
    ],
)  # fmt: skip
def test_means_what_it_says(text, means, state):
    for axis in range(3):
        assert np.allclose(Expression(text, "here").values(state, axis), means(state, axis))


REFUSED = [
    *((text, "is not allowed") for text in (
        "__import__('os').system('true')", "f.__class__", "(lambda: f)()", "[f for f in f]", "f if f else f", "f and fj",
        "'f'", "f @ fj", "True * f", "f * 1e999", "f[0]", "exp(f, x=2)")),
    ("sqr(f)", r"unknown function 'sqr'; did you mean sqrt"),
    ("eval(f)", "unknown function 'eval'"),
    ("maximum(f)", "maximum has 1 arguments, 2 needed"),
    ("exp + f", "'exp' is a function"),
    ("_secret * f", "no name of a quantity"),
    ("f +", "is no formula"),
    ("", "is no formula"),
    ("2 * 3", "depends on nothing"),
    ("f" + " + f" * 300, "characters, at most"),
]  # fmt: skip


@each(REFUSED)
def test_refuses_everything_else(row):
    with pytest.raises(FormulaInvalid, match=row[1]):
        Expression(row[0], "here")


def test_refuses_values_that_are_no_numbers_and_names_a_quantity_that_is_not_recorded(state):
    with pytest.raises(FormulaInvalid, match="not finite in 24 of 24 dwells"):
        Expression("log(humidity_pct - 100)", "here").values(state, 0)
    with pytest.raises(UnknownName, match=r"no 'humidty_pct'; .* did you mean humidity_pct"):
        Expression("humidty_pct * f", "formula wet").values(state, 0)
    with pytest.raises(UnknownName, match="formula wet: the dwells have no 'supply'"):
        Expression("supply", "formula wet").values(state, 0)


def test_a_formula_is_an_effect_like_others(state):
    made = Formula("humidity_bias", ["humidity_pct", "humidity_pct*f"], why="Moisture swells the glue.", symbol="h")
    assert (made.columns(state, 1).shape, made.names(0)) == ((2, 12, 2), ("h1", "h2"))
    assert made.equation == "h1·(humidity_pct) + h2·(humidity_pct*f)"
