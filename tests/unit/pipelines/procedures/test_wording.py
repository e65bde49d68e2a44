"""Numbers in the findings of procedures: digits by the uncertainty, probabilities that are no zero."""

import pytest

from pipelines.procedures.wording import probability, signed, with_uncertainty
from pipelines.report.numbers import with_uncertainty as in_tables


@pytest.mark.parametrize(
    ("value", "expanded", "text"),
    [
        (-507.77, 614.0, "−510 ± 610"), (4158.8, 131.2, "4160 ± 130"), (-0.0409, 1.0, "0.0 ± 1.0"),
        (1.3794, 0.1712, "1.38 ± 0.17"), (2177.51, 2.39, "2177.5 ± 2.4"), (3.2, 0.0, "3.2"), (-3.2, float("nan"), "−3.2"),
        (-1.538e-9, 2.3e-11, "−1.538e−09 ± 2.3e−11"),
    ],
)  # fmt: skip
def test_a_value_has_the_digits_of_its_uncertainty(value: float, expanded: float, text: str) -> None:
    assert with_uncertainty(value, expanded) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(-0.04, "0.0"), (0.04, "0.0"), (0.0, "0.0"), (-0.06, "−0.1"), (0.2, "+0.2"), (-2.345, "−2.3"), (12.0, "+12.0")],
)
def test_a_difference_has_its_sign_and_a_rounded_zero_has_none(value: float, text: str) -> None:
    assert signed(value, 1) == text


def test_a_table_prints_no_negative_zero() -> None:
    assert in_tables(-0.0409, 1.0) == ("0.0", "1.0")


def test_a_probability_is_never_printed_as_zero() -> None:
    assert probability(0.68) == "p = 0.68"
    assert probability(3.2e-12) == "p < 0.001"
    assert probability(0.0) == "p < 0.001"
