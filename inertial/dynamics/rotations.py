"""The points of a rotation: means over parts of a turn, and what the table and gravity do in each."""

from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import Array, Flags
from inertial.dynamics.spectra import STANDARD_GRAVITY
from inertial.frames import to_fixture

NODES = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)])
SHARES = np.array([5.0, 8.0, 5.0]) / 18.0
"""Gauss–Legendre over the angles of a point: exact to 10⁻⁷ for waves of up to five a turn over 10°."""
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Rotations:
    """The points of a test in the order of time, all (n,): means over the angles of a part of a turn, or at rest.

    outer, inner : angles, rad; inner_turns : whether the inner axis turns, else the outer one
    span : angle over which the mean is, rad; rate, acceleration : of the turning axis, rad/s and rad/s²
    time : s; sweep : number of the sweep, −1 at rest
    uncertain : (n, 6), independent errors of the angle in a sweep, rad of one standard deviation; zero at rest
    """

    outer: Array
    inner: Array
    inner_turns: Array
    span: Array
    rate: Array
    acceleration: Array
    time: Array
    sweep: Array
    uncertain: Array

    @property
    def turning(self) -> Flags:
        """Whether the table turns, (n,)."""
        return np.asarray(self.sweep >= 0, dtype=np.bool_)

    @property
    def angle(self) -> Array:
        """Angle of the axis that turns, (n,), rad."""
        return np.where(self.inner_turns > 0, self.inner, self.outer)

    def later(self, delay: Array) -> "Rotations":
        """The points where the table is ``delay`` s (outer, inner) after the encoder's readings."""
        ahead = self.rate * np.where(self.inner_turns > 0, delay[1], delay[0])
        inner = self.inner_turns > 0
        return replace(
            self, outer=self.outer + np.where(inner, 0.0, ahead), inner=self.inner + np.where(inner, ahead, 0.0)
        )


@dataclass(frozen=True)
class Nodes:
    """The angles of each point at which its mean is computed: arrays (3, n, …).

    outer, inner : rad; force : (3, n, 3), g in the fixture; axis : (3, n, 3), of turning, unit vector in the fixture
    slope : (3, n, 3), of the force over the turning angle, g/rad
    """

    points: Rotations
    outer: Array
    inner: Array
    force: Array
    axis: Array
    slope: Array

    @property
    def angle(self) -> Array:
        """Angle (3, n) of the axis that turns, rad."""
        return np.where(self.points.inner_turns > 0, self.inner, self.outer)

    @classmethod
    def of(cls, points: Rotations) -> "Nodes":
        """The nodes of points."""
        step = 0.5 * NODES[:, None] * points.span
        about_inner = points.inner_turns > 0
        outer, inner = points.outer + np.where(about_inner, 0.0, step), points.inner + np.where(about_inner, step, 0.0)
        force = to_fixture(UP, outer, inner)
        zero = np.zeros_like(inner)
        about_x = np.stack([np.cos(inner), -np.sin(inner), zero], axis=-1)
        axis = np.where(about_inner[:, None], np.stack([zero, zero, zero + 1.0], axis=-1), about_x)
        return cls(points, outer, inner, force, axis, np.cross(force, axis))

    def radial(self) -> Array:
        """Force (3, n, 3, 3) in g per m of the place of the proof mass in the fixture: α×r + ω×(ω×r)."""
        n, w, a = self.axis, self.points.rate[:, None, None], self.points.acceleration[:, None, None]
        eye = np.eye(3)
        cross = np.cross(n[..., None, :], eye)  # rows: n × e
        across = np.swapaxes(cross, -1, -2)
        inward = n[..., :, None] * n[..., None, :] - eye
        return (a * across + w**2 * inward) / STANDARD_GRAVITY


def mean(values: Array) -> Array:
    """Mean (n, …) over the angles of each point of values (3, n, …) at its nodes."""
    return np.tensordot(SHARES, values, axes=1)
