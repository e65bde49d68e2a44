"""Numbers in the findings of procedures: digits by the uncertainty, probabilities that are no zero."""

from pipelines.procedures.wording import probability, signed, with_uncertainty
from pipelines.report.numbers import with_uncertainty as in_tables


def test_numbers_have_the_digits_of_their_uncertainty_a_sign_and_no_negative_zero() -> None:
    for value, expanded, text in (
        (-507.77, 614.0, "−510 ± 610"), (4158.8, 131.2, "4160 ± 130"), (-0.0409, 1.0, "0.0 ± 1.0"),
        (1.3794, 0.1712, "1.38 ± 0.17"), (2177.51, 2.39, "2177.5 ± 2.4"), (3.2, 0.0, "3.2"), (-3.2, float("nan"), "−3.2"),
        (-1.538e-9, 2.3e-11, "−1.538e−09 ± 2.3e−11"),
    ):  # fmt: skip
        assert with_uncertainty(value, expanded) == text
    differences = {-0.04: "0.0", 0.04: "0.0", 0.0: "0.0", -0.06: "−0.1", 0.2: "+0.2", -2.345: "−2.3", 12.0: "+12.0"}
    assert {value: signed(value, 1) for value in differences} == differences
    assert in_tables(-0.0409, 1.0) == ("0.0", "1.0")
    assert [probability(p) for p in (0.68, 3.2e-12, 0.0)] == ["p = 0.68", "p < 0.001", "p < 0.001"]
