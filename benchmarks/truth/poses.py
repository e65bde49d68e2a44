"""Pose plans of a two-axis table, worked out from directions; nothing here is read from the product."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def _angles(directions: Floats) -> Floats:
    """Outer and inner angle, (n, 2) deg, that bring `up` onto each direction of the fixture, (n, 3)."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    outer = np.degrees(np.arccos(np.clip(unit[:, 2], -1.0, 1.0)))
    inner = np.degrees(np.arctan2(unit[:, 0], unit[:, 1]))
    return np.column_stack([outer, inner])


def _cube(kinds: tuple[int, ...]) -> Floats:
    """Directions to faces (1), edges (2) and corners (3) of a cube."""
    corners = [d for d in product((-1.0, 0.0, 1.0), repeat=3) if sum(map(abs, d)) in kinds]
    return _angles(np.array(corners))


def _fibonacci(count: int) -> Floats:
    index = np.arange(count) + 0.5
    height = 1.0 - 2.0 * index / count
    turn = np.pi * (1.0 + 5.0**0.5) * index
    ring = np.sqrt(1.0 - height**2)
    return _angles(np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height]))


def _orthogonal() -> Floats:
    """Outer angles in 90° steps over one turn and a half, with the four inner quarter turns: 24 poses."""
    return np.array(list(product((-180.0, -90.0, 0.0, 90.0, 180.0, 270.0), (0.0, 90.0, 180.0, 270.0))))


def _tilt_scan() -> Floats:
    """Fine tilts through zero on each axis, and the faces: what sees dead zones and converter steps."""
    small = np.array([-9.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 9.0])
    around_y = np.column_stack([90.0 + small, np.full(8, 20.0)])
    around_x = np.column_stack([np.full(8, 75.0), small])
    around_inner = np.column_stack([np.full(8, 80.0), 90.0 + small])
    return np.vstack([_cube((1,)), around_y, around_x, around_inner, _fibonacci(12)])


PLANS: dict[str, Floats] = {
    "six": _cube((1,)),
    "eighteen": _cube((1, 2)),
    "twenty_six": _cube((1, 2, 3)),
    "orthogonal24": _orthogonal(),
    "fibonacci24": _fibonacci(24),
    "tilt_scan": _tilt_scan(),
}

SOAKS: dict[str, tuple[float, ...]] = {
    "one": (25.0,),
    "three": (-20.0, 25.0, 70.0),
    "five": (-40.0, -10.0, 20.0, 50.0, 80.0),
    "nine": (-40.0, -10.0, 20.0, 50.0, 80.0, 50.0, 20.0, -10.0, -40.0),
    "shuffled": (20.0, 80.0, -10.0, 50.0, -40.0, 35.0, 65.0, 5.0),
    "steps": (-30.0, -15.0, -5.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 50.0, 30.0, 10.0),
}
