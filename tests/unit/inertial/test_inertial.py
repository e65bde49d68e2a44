"""Small modules of the science: frames and poses, operators, correction, static intervals, positions of a motion."""

from dataclasses import replace

import lots
import numpy as np
import pytest
from each import each

from inertial import frames, operators
from inertial.change_of_level import several_levels
from inertial.correction import correct, remaining_step
from inertial.state import State
from inertial.static_intervals import find


def test_forces_are_products_of_right_handed_rotations_and_angles_turn_gravity_back(rng):
    for plan, up in (("fibonacci", (0.0, 0.0, 1.0)), ("six", (1e-3, -2e-3, 1.0))):
        angles = lots.directions(plan)
        np.testing.assert_allclose(frames.force_from_angles(*angles.T, up), lots.force(angles, up), atol=1e-15)
    np.testing.assert_allclose(frames.rotation_x(np.pi / 2) @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(frames.rotation_z(np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    wanted = directions(rng, 50)
    np.testing.assert_allclose(frames.force_from_angles(*frames.angles_from_force(wanted)), wanted, atol=1e-12)


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


EFFECTS = ["bias", "scale", "third_order"]
COEFFICIENTS = np.tile([0.01, 1.0, 1e-3], (3, 1))  # each axis, in g


def test_a_force_in_range_is_solved_and_an_output_far_outside_leaves_a_step(rng: np.random.Generator) -> None:
    force = rng.uniform(-1.0, 1.0, (50, 3))
    output = 0.01 + force + 1e-3 * force**3
    output[49] = [900.0, 0.0, 0.0]
    nothing = State(np.zeros((50, 3)), np.zeros(50))
    with np.errstate(all="ignore"):
        corrected = correct(EFFECTS, nothing, output, COEFFICIENTS, {})
        left = remaining_step(EFFECTS, replace(nothing, force=corrected), output, COEFFICIENTS, {}, corrected)
    np.testing.assert_allclose(corrected[:49], force[:49], atol=1e-9)
    step = np.abs(left).max(axis=1)
    assert np.all(step[:49] < 1e-9)
    assert not step[49] < 1e-6


def directions(rng: np.random.Generator, *shape: int) -> np.ndarray:
    f = rng.normal(size=(*shape, 3))
    return f / np.linalg.norm(f, axis=-1, keepdims=True)


def test_static_intervals_are_those_that_were_made_and_a_record_that_never_moves_is_one(
    rng: np.random.Generator,
) -> None:
    rate, still = 50.0, []
    parts = []
    for _ in range(8):
        still.append((sum(map(len, parts)), 400))
        parts += [np.tile(directions(rng), (400, 1)), 0.5 * rng.normal(size=(150, 3))]
    record = np.concatenate(parts) + 2e-3 * rng.normal(size=(8 * 550, 3))
    for scale in (1.0, 4e3):
        intervals = find(record * scale, rate)
        assert len(intervals) == 8
        for (start, length), a, b in zip(still, intervals.start, intervals.stop, strict=True):
            assert start <= a < start + 60
            assert start + length - 60 < b <= start + length
    intervals = find(rng.normal(size=(5000, 3)), 100.0)
    assert (intervals.start.tolist(), intervals.stop.tolist()) == ([0], [5000])


def test_pieces_near_the_shortest_are_a_motion_and_longer_ones_are_positions(rng: np.random.Generator) -> None:
    steps = rng.normal(size=(40, 3))
    for samples, positions in ((6, 1), (25, 40)):
        record = np.repeat(steps, samples, axis=0) + 0.001 * rng.normal(size=(40 * samples, 3))
        assert several_levels(record) == positions
