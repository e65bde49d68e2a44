"""The correction undoes the model, and says whether its iteration has converged."""

import numpy as np

from inertial.correction import correct, remaining_step
from inertial.state import State

EFFECTS = ["bias", "scale", "third_order"]
COEFFICIENTS = np.tile([0.01, 1.0, 1e-3], (3, 1))  # each axis, in g


def solved(output: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The corrected output, and the further step that is left in each row."""
    nothing = State(np.zeros(output.shape), np.zeros(len(output)))
    corrected = correct(EFFECTS, nothing, output, COEFFICIENTS, {})
    step = remaining_step(EFFECTS, State(corrected, np.zeros(len(output))), output, COEFFICIENTS, {}, corrected)
    return corrected, np.abs(step).max(axis=1)


def test_a_force_in_range_is_solved_and_an_output_far_outside_leaves_a_step(rng: np.random.Generator) -> None:
    force = rng.uniform(-1.0, 1.0, (50, 3))
    output = 0.01 + force + 1e-3 * force**3
    output[49] = [900.0, 0.0, 0.0]
    with np.errstate(all="ignore"):
        corrected, step = solved(output)
    np.testing.assert_allclose(corrected[:49], force[:49], atol=1e-9)
    assert np.all(step[:49] < 1e-9)
    assert not step[49] < 1e-6
