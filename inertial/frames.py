"""Specific force on a two-axis table: outer axis horizontal along the laboratory's x, inner axis the fixture's z.

At rest a device feels +1 g upwards: f = (Rx(outer)·Rz(inner))ᵀ·(0, 0, 1). Right-handed, radians.
"""

import numpy as np
from numpy.typing import ArrayLike

from inertial.arrays import Array

UP: tuple[float, float, float] = (0.0, 0.0, 1.0)

_ROUNDING = 1e-14  # g; smaller components are rounding of sines and cosines


_TURNED_G = 0.05
"""Change of the force along a direction, g, from which poses show a sensor's response to it; less is the wobble of a plane."""

_UPRIGHT = 0.9
"""Cosine of the angle of x to the vertical above which the heading is that of y."""


def rotation_x(angle: ArrayLike) -> Array:
    """Rotation matrices about x, shape (..., 3, 3), for ``angle`` (...) in rad."""
    a = np.asarray(angle, dtype=float)
    c, s, o, l = np.cos(a), np.sin(a), np.zeros_like(a), np.ones_like(a)
    return np.stack([l, o, o, o, c, -s, o, s, c], axis=-1).reshape(*a.shape, 3, 3)


def rotation_z(angle: ArrayLike) -> Array:
    """Rotation matrices about z, shape (..., 3, 3), for ``angle`` (...) in rad."""
    a = np.asarray(angle, dtype=float)
    c, s, o, l = np.cos(a), np.sin(a), np.zeros_like(a), np.ones_like(a)
    return np.stack([c, -s, o, s, c, o, o, o, l], axis=-1).reshape(*a.shape, 3, 3)


def to_fixture(vector: ArrayLike, outer: ArrayLike, inner: ArrayLike) -> Array:
    """A laboratory vector seen in the fixture's frame: (Rx(outer)·Rz(inner))ᵀ·vector.

    Parameters
    ----------
    vector : (3,) or (..., 3), any unit
    outer, inner : (...), rad

    Returns
    -------
    (..., 3), the vector's unit
    """
    alpha, beta = np.asarray(outer, dtype=float), np.asarray(inner, dtype=float)
    x, y, z = np.moveaxis(np.asarray(vector, dtype=float), -1, 0)
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    across = ca * y + sa * z
    return np.stack(np.broadcast_arrays(cb * x + sb * across, -sb * x + cb * across, -sa * y + ca * z), axis=-1)


def force_from_angles(outer: ArrayLike, inner: ArrayLike, up: ArrayLike = UP) -> Array:
    """Specific force in the fixture's frame, (..., 3) in g, at table angles ``outer``, ``inner`` (...) in rad."""
    return without_rounding(to_fixture(up, outer, inner))


def without_rounding(force: Array) -> Array:
    """A specific force in g with what rounding left of zeros made zero: the cosine of 90° is 6e‑17, not a force to fit."""
    return np.where(np.abs(force) < _ROUNDING, 0.0, force)


def unseen_directions(force: Array) -> tuple[int, ...]:
    """Directions of the fixture along which the force (..., n, 3), g, does not change: no pose shows the response to it."""
    return tuple(np.flatnonzero(np.max(np.ptp(force, axis=-2).reshape(-1, 3), axis=0) < _TURNED_G).tolist())


def shown_force(force: Array, axes: tuple[int, ...]) -> Array:
    """The force (..., n, 3), g, less what stays the same along unseen directions, where a device has fewer than three axes."""
    unseen = unseen_directions(force) if len(axes) < 3 else ()
    return np.where(np.isin(np.arange(3), unseen), 0.0, force) if unseen else force


def angles_from_force(force: ArrayLike) -> tuple[Array, Array]:
    """Table angles (outer, inner), each (...) in rad, that turn gravity along ``force`` (..., 3).

    outer lies in [0, π], inner in (-π, π]; where the force is along the inner axis, inner is 0.
    """
    f = np.asarray(force, dtype=float)
    across = np.hypot(f[..., 0], f[..., 1])
    inner = np.where(across > 1e-12, np.arctan2(f[..., 0], f[..., 1]), 0.0)
    return np.arctan2(across, f[..., 2]), inner


def horizontal(force: ArrayLike, heading: ArrayLike) -> tuple[Array, Array]:
    """The laboratory's x and y seen in the frame of a unit put down by hand, each (..., 3).

    The heading is the direction, counter-clockwise from the laboratory's x as seen from above, in which the unit's x axis
    points; that of its y axis where x is up or down.

    Parameters
    ----------
    force : (..., 3), g, specific force of the placement; heading : (...), rad
    """
    f = np.asarray(force, dtype=float)
    up = f / np.linalg.norm(f, axis=-1, keepdims=True)
    pointer = np.where(np.abs(up[..., :1]) > _UPRIGHT, (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    ahead = pointer - np.sum(pointer * up, axis=-1, keepdims=True) * up
    ahead = ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)
    left = np.cross(up, ahead)
    c, s = (part[..., None] for part in (np.cos(heading), np.sin(heading)))
    return c * ahead - s * left, s * ahead + c * left
