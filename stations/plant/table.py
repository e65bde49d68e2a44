"""The two-axis tilt table: motion of each axis as a function of time, and where it turns gravity."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stations.plant.device import keyed_normal

Array = NDArray[np.float64]

RING_DEG = 0.01  # overswing at the end of a move
RING_HZ = 6.0
RING_TAU_S = 0.35
HOLD_DEG = 0.0004  # where the servo comes to rest, one sigma around the target
ENCODER_NOISE_DEG = 0.0003
ENCODER_STEP_DEG = 0.001
IN_POSITION_S = 1.5  # by then the ringing has fallen below the window


@dataclass(frozen=True)
class Move:
    """A trapezoidal move; ``start`` and ``end`` in s on the plant's clock, angles in degrees."""

    start: float
    origin: float
    target: float
    rest: float
    speed: float
    acceleration: float

    @property
    def _ramp(self) -> float:
        """Seconds of acceleration: to the speed limit, or half way."""
        return min(self.speed / self.acceleration, math.sqrt(abs(self.target - self.origin) / self.acceleration))

    @property
    def duration(self) -> float:
        """Seconds from start to the end of the profile."""
        distance, ramp = abs(self.target - self.origin), self._ramp
        if ramp == 0.0:
            return 0.0
        return 2.0 * ramp + max(0.0, distance / (self.acceleration * ramp) - ramp)

    @property
    def end(self) -> float:
        """When the profile has reached the target; the axis rings on."""
        return self.start + self.duration

    def share(self, time: Array) -> Array:
        """Speed at ``time`` (n,) over the largest of the move."""
        ramp, t = self._ramp, time - self.start
        return np.clip(np.minimum(t, self.duration - t) / ramp, 0.0, 1.0) if ramp > 0.0 else np.zeros_like(t)

    def angle(self, time: Array) -> Array:
        """The angle at ``time`` (n,), degrees."""
        ramp, total = self._ramp, self.duration
        t = np.clip(time - self.start, 0.0, total)
        a = self.acceleration
        up = 0.5 * a * np.minimum(t, ramp) ** 2
        cruise = a * ramp * np.clip(t - ramp, 0.0, max(0.0, total - 2.0 * ramp))
        down = np.maximum(t - (total - ramp), 0.0)
        travelled = up + cruise + a * ramp * down - 0.5 * a * down**2
        direction = math.copysign(1.0, self.target - self.origin)
        after = np.maximum(time - self.end, 0.0)
        size = RING_DEG * min(1.0, abs(self.target - self.origin))
        ring = size * np.exp(-after / RING_TAU_S) * np.sin(2.0 * math.pi * RING_HZ * after)
        settled = (self.rest - self.target) * np.clip(after, 0.0, 1.0)
        return self.origin + direction * (travelled + ring) + settled


class Axis:
    """An axis: a servo with its encoder, and its errors.

    ``zero_deg`` is by how much the encoder is off, ``play_deg`` how far the shaft may lag behind it, ``stuck_at`` what a stuck
    encoder says; ``homed`` is the drive's own belief. ``ripple`` are waves of the angle while it turns (orders a turn, degrees),
    ``late_s`` the age of an encoder reading and its standard deviation.
    """

    def __init__(self, seed: int, channel: int) -> None:
        self._seed, self._channel = seed, channel
        self._moves = 0
        self.scatter_deg = 0.0  # shaft against encoder, drawn at every move
        self._off = 0.0
        self.move = Move(-1e9, 0.0, 0.0, 0.0, 1.0, 1.0)
        self.zero_deg, self.play_deg = 0.0, 0.0
        self.stuck_at: float | None = None
        self.homed = True
        self.ripple: tuple[tuple[int, float], ...] = ()
        self.late_s = (0.0, 0.0)
        self._side = 1.0  # from where the last move came
        self._stalled = False
        self._held: tuple[float, float, float] | None = None  # target, speed and acceleration of a move that is held up

    def go(self, now: float, target: float, speed: float, acceleration: float) -> None:
        """Starts a move to an absolute target; the axis stands still or rings when this is called."""
        if self._stalled:
            self._held = target, speed, acceleration
            return
        self._moves += 1
        if self.scatter_deg > 0.0:
            self._off = self.scatter_deg * float(keyed_normal(self._seed, self._channel + 2, self._moves, 1)[0])
        slip = HOLD_DEG * float(keyed_normal(self._seed, self._channel, self._moves, 1)[0])
        origin = float(self.angle(np.array([now]))[0])
        if abs(target - origin) > self.play_deg:
            self._side = math.copysign(1.0, target - origin)
        self.move = Move(now, origin, target, target + slip, speed, acceleration)

    def stall(self, now: float) -> None:
        """Holds the axis up where it is."""
        if self.moving(now):
            self._held = self.move.target, self.move.speed, self.move.acceleration
        self._stalled = True
        here = float(self.angle(np.array([now]))[0])
        self.move = Move(now - IN_POSITION_S, here, here, here, 1.0, 1.0)

    def release(self, now: float, *, resumes: bool) -> None:
        """Sets the axis free; it goes on to its target, or has forgotten it."""
        held, self._held, self._stalled = self._held, None, False
        if held is not None and resumes:
            self.go(now, *held)

    def halt(self, now: float) -> None:
        """Stops a move where it is, and forgets the rest."""
        self._held = None
        if self.moving(now):
            here = float(self.angle(np.array([now]))[0])
            self.move = Move(now, here, here, here, 1.0, 1.0)

    def lose_zero(self, offset: float) -> None:
        """The encoder says ``offset`` degrees more from now on; the shaft stays where it is."""
        m = self.move
        self.move = replace(m, origin=m.origin + offset, target=m.target + offset, rest=m.rest + offset)
        self.zero_deg += offset

    def angle(self, time: Array) -> Array:
        """The shaft's angle as the encoder would see it without noise, degrees."""
        angle = self.move.angle(time)
        for order, size in self.ripple:
            angle = angle + size * self.move.share(time) * np.sin(np.radians(order * angle) + order)
        return angle

    def turns(self, time: Array) -> bool:
        """Whether the axis moves, or rings, at any of ``time`` (n,)."""
        return bool(time[-1] > self.move.start and time[0] < self.move.end + IN_POSITION_S)

    def shaft(self, time: Array) -> Array:
        """The shaft's true angle, degrees."""
        return self.angle(time) - self.zero_deg - 0.5 * self._side * self.play_deg + self._off

    def moving(self, now: float) -> bool:
        """Whether the profile is running, or held up."""
        return self._held is not None or self.move.start <= now < self.move.end

    def in_position(self, now: float) -> bool:
        """Whether the axis has been inside its window long enough."""
        return self._held is None and now >= self.move.end + IN_POSITION_S

    def encoder(self, now: float) -> float:
        """The encoder's reading: quantised to 0.001°, noise of its own at every millisecond."""
        if self.stuck_at is not None:
            return self.stuck_at
        noise = ENCODER_NOISE_DEG * float(keyed_normal(self._seed, self._channel + 1, int(now * 1000), 1)[0])
        seen = now - self._age(now)
        angle = float(self.angle(np.array([seen]))[0]) + noise
        return round(angle / ENCODER_STEP_DEG) * ENCODER_STEP_DEG

    def _age(self, now: float) -> float:
        """Age of a reading, s; the reading of a still axis does not depend on it."""
        latency, jitter = self.late_s
        if jitter == 0.0:
            return latency
        drawn = float(keyed_normal(self._seed, self._channel + 3, int(now * 1000), 1)[0])
        return max(0.0, latency + jitter * drawn)


def turn(up: Array, outer: Array, inner: Array, orthogonality: float = 0.0) -> Array:
    """Specific force in the fixture, (n, 3) in g: first the inner axis, then the outer one turned back.

    up : (3,), the direction opposite to gravity in the laboratory, g
    outer, inner : (n,), rad; orthogonality : rad, turn about y between the two axes
    """
    y = np.cos(outer) * up[1] + np.sin(outer) * up[2]
    z = np.cos(outer) * up[2] - np.sin(outer) * up[1]
    x = np.full_like(y, up[0])
    if orthogonality:
        c, s = math.cos(orthogonality), math.sin(orthogonality)
        x, z = c * x - s * z, s * x + c * z
    return np.stack((np.cos(inner) * x + np.sin(inner) * y, np.cos(inner) * y - np.sin(inner) * x, z), axis=-1)
