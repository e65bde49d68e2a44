"""Static intervals are those that were made."""

import numpy as np

from inertial.static_intervals import find


def directions(rng: np.random.Generator, *shape: int) -> np.ndarray:
    f = rng.normal(size=(*shape, 3))
    return f / np.linalg.norm(f, axis=-1, keepdims=True)


def test_static_intervals_are_those_that_were_made(rng: np.random.Generator) -> None:
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


def test_a_record_that_never_moves_is_one_interval(rng: np.random.Generator) -> None:
    intervals = find(rng.normal(size=(5000, 3)), 100.0)
    assert (intervals.start.tolist(), intervals.stop.tolist()) == ([0], [5000])
