"""Verification poses of a recipe: selection, repetitions, and distribution over the soaks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inertial import poses
from inertial.arrays import Array
from inertial.frames import force_from_angles
from schemas.poses import Pose
from schemas.recipe import Recipe

WHOLE_DEG = 5.0


def numbered(letter: str, angles: Array) -> list[Pose]:
    """Poses at angles (n, 2) in degrees, named by a letter and a number."""
    width = len(str(len(angles)))
    return [
        Pose(name=f"{letter}{k:0{width}d}", outer_deg=float(outer), inner_deg=float(inner))
        for k, (outer, inner) in enumerate(angles, start=1)
    ]


def apart(chosen: Array, given: Sequence[Pose]) -> list[Pose]:
    """As many verification poses as ``given`` has, each with the largest angle to the fit's poses and to one another."""
    count = len({(p.outer_deg, p.inner_deg) for p in given})
    grid = WHOLE_DEG * np.round(poses.fibonacci(400) / WHOLE_DEG)
    force, used = force_from_angles(*np.radians(grid).T), force_from_angles(*np.radians(chosen).T)
    angles: list[Array] = []
    for _ in range(count):
        near = np.max(force @ used.T, axis=1)
        best = int(np.argmin(near))
        angles.append(grid[best])
        used = np.concatenate([used, force[best : best + 1]])
    return numbered("v", np.array(angles).reshape(-1, 2))


def turns(count: int, repeats: int, soak: int, soaks: int) -> list[int]:
    """Numbers, from 1, of the verification poses measured at a soak; the sequence continues from soak to soak."""
    return [k for turn in range(repeats) for k in range(1, count + 1) if (k + turn) % soaks == soak]


def verified_in(recipe: Recipe) -> int:
    """Repetitions of each verification pose in the whole run, rounded up."""
    taken = [(p.outer_deg, p.inner_deg) for k in range(len(recipe.temperatures_C)) for p in recipe.verification_at(k)]
    return -(-len(taken) // len(set(taken))) if taken else 1
