"""A play in stretches is the play point by point, a recursion of few signals that of many."""

import numpy as np
import pytest
from each import each

from inertial import operators


def point_by_point(signal: np.ndarray, half_width: float, start: float) -> np.ndarray:
    """The definition: every step moves the position, which stays within −1 … 1."""
    out = np.empty(signal.shape)
    out[..., 0] = start
    for k, change in enumerate(np.moveaxis(np.diff(signal, axis=-1), -1, 0)):
        out[..., k + 1] = np.clip(out[..., k] + change / half_width, -1.0, 1.0)
    return out


@pytest.mark.parametrize("shape", [(1,), (2,), (7,), (3, 1), (3, 101), (2, 3, 50), (65, 400)])
@pytest.mark.parametrize("half_width", [0.3, 5.0, 1000.0])
def test_a_play_is_its_definition_point_by_point(shape: tuple[int, ...], half_width: float) -> None:
    signal = np.cumsum(np.random.default_rng(20_261_150).standard_normal(shape), axis=-1)
    for start in (-1.0, 0.0, 0.3, 1.0):
        expected = point_by_point(signal, half_width, start)
        np.testing.assert_allclose(operators.play(signal, half_width, start), expected, atol=1e-12)
    memory = 0.5 * (point_by_point(signal, half_width, 1.0) - point_by_point(signal, half_width, -1.0))
    np.testing.assert_allclose(operators.play_memory(signal, half_width), memory, atol=1e-12)


@each([1, 3, 8, 9, 30])
def test_a_recursion_of_few_signals_is_that_of_many(rows: int, rng: np.random.Generator) -> None:
    keep, drive, start = rng.random(40), rng.normal(size=(rows, 40)), rng.normal(size=rows)
    expected = [start]
    for k in range(drive.shape[1]):
        expected.append(keep[k] * expected[-1] + drive[:, k])
    np.testing.assert_array_equal(operators.recursion(start, keep, drive), np.stack(expected, axis=1))
