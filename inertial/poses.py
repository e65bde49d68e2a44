"""Named plans of poses, as table angles (outer, inner) in degrees.

Orthogonal plans take faces, edges and corners of the cube; 24 directions of a Fibonacci lattice on the sphere see four
times the physics of the 24 orthogonal poses (rank 9/16/24 instead of 6/6/6 for polynomials of degree 2/3/4).
"""

from collections.abc import Callable
from itertools import product

import numpy as np

from inertial.arrays import Array
from inertial.frames import angles_from_force


def _angles(directions: Array) -> Array:
    outer, inner = angles_from_force(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    angles: Array = np.degrees(np.stack([outer, inner], axis=1))
    return np.round(angles, 9) + 0.0


def _cube(*weights: int) -> Array:
    """Directions of the cube with so many non-zero components: 1 faces, 2 edges, 3 corners."""
    grid = np.array([v for w in weights for v in product((1.0, 0.0, -1.0), repeat=3) if np.count_nonzero(v) == w])
    return _angles(grid)


def fibonacci(count: int) -> Array:
    """Angles (count, 2) in degrees of ``count`` directions spread evenly by the golden angle."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z**2)
    return _angles(np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1))


def orthogonal24() -> Array:
    """Angles (24, 2) in degrees of all 24 orientations of a cube: every face up, four times.

    Turns about the vertical change nothing in the force: on a two-axis table the lateral faces come twice, approached
    anew, instead of the turns it cannot make.
    """
    turns = (0.0, 90.0, 180.0, 270.0)
    return np.array([(outer, inner) for outer in (0.0, 90.0, -90.0, 180.0, 90.0, -90.0) for inner in turns])


def _nine() -> Array:
    """Six faces and three edges that tie the axes pairwise."""
    edges = np.array([(1.0, 1.0, 0.0), (0.0, 1.0, 1.0), (1.0, 0.0, 1.0)])
    return np.vstack([_cube(1), _angles(edges)])


NAMED: dict[str, Callable[[], Array]] = {
    "six": lambda: _cube(1),
    "nine": _nine,
    "twelve": lambda: _cube(2),
    "eighteen": lambda: _cube(1, 2),
    "twenty_six": lambda: _cube(1, 2, 3),
    "fibonacci24": lambda: fibonacci(24),
    "orthogonal24": orthogonal24,
}


def plan(name: str) -> Array:
    """Angles (n, 2) in degrees, outer and inner, of a named plan.

    Raises
    ------
    KeyError
        No plan has this name.
    """
    return NAMED[name]()
