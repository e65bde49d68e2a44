"""The correction undoes the model, and says whether its iteration has converged."""

import numpy as np

from inertial.correction import correct, remaining_step
from inertial.effects import get
from inertial.state import State

LINEAR = ("bias", "scale", "misalignment")
THERMAL = (*LINEAR, "bias_temperature", "scale_temperature")


EFFECTS = ["bias", "scale", "third_order"]


def coefficients(cubic: float) -> np.ndarray:
    """(3, 3) of bias, scale and third order, each axis in g."""
    assert [len(get(name).names(0)) for name in EFFECTS] == [1, 1, 1]
    return np.tile([0.01, 1.0, cubic], (3, 1))


def test_a_force_in_range_is_solved_and_the_further_step_is_rounding(rng: np.random.Generator) -> None:
    force = rng.uniform(-1.0, 1.0, (50, 3))
    output = 0.01 + force + 1e-3 * force**3
    solved = correct(EFFECTS, State(force, np.zeros(len(force))), output, coefficients(1e-3), {})
    np.testing.assert_allclose(solved, force, atol=1e-9)
    assert (
        np.max(
            np.abs(remaining_step(EFFECTS, State(force, np.zeros(len(force))), output, coefficients(1e-3), {}, solved))
        )
        < 1e-9
    )


def test_an_output_far_outside_leaves_a_step_that_is_no_rounding() -> None:
    output = np.array([[0.5, 0.5, 0.5], [900.0, 0.0, 0.0]])
    with np.errstate(all="ignore"):
        solved = correct(EFFECTS, State(np.zeros((2, 3)), np.zeros(2)), output, coefficients(1e-3), {})
        step = np.abs(remaining_step(EFFECTS, State(solved, np.zeros(2)), output, coefficients(1e-3), {}, solved)).max(
            axis=1
        )
    assert step[0] < 1e-9
    assert not step[1] < 1e-6
