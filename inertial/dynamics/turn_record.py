"""A record of turns: what the readings of the encoder say of angle, rate and acceleration at any instant, and how well."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from inertial.errors import NotIdentified

LOW_ORDERS = (1, 2)
"""Waves of the angle per turn that every fit has: load and coupling make them, and forces of one or two waves look like them."""
MOST_WAVES = 6
WAVE_P = 1e-3  # largest probability of a further wave by chance, times the number of orders
FEWEST_READINGS = 40  # in a turn
NEAR = np.radians(0.05)  # of an end where the axis stands
LEAVING_S = 0.15  # before the last reading at an end that no sample is taken from


@dataclass(frozen=True)
class Sweep:
    """Whole turns at a steady rate, fitted to readings of the encoder.

    middle : s; value : (2 + 2·waves,) angle there in rad, rate in rad/s, then cosine and sine of each order in rad
    covariance : of ``value``, by the scatter of the readings; scatter : its standard deviation, rad
    begin, end : s, of the whole turns
    """

    middle: float
    value: Array
    orders: tuple[int, ...]
    covariance: Array
    scatter: float
    begin: float
    end: float

    @property
    def rate(self) -> float:
        """Mean rate, rad/s, negative backward."""
        return float(self.value[1])

    def angle(self, time: Array) -> Array:
        """Angle (n,), rad."""
        return _rows(time - self.middle, self.value[:2], self.orders) @ self.value

    def motion(self, time: Array) -> tuple[Array, Array]:
        """Rate (n,), rad/s, and acceleration (n,), rad/s²."""
        turn = self.value[0] + self.rate * (time - self.middle)
        rate, acceleration = np.full_like(time, self.rate), np.zeros_like(time)
        for k, order in enumerate(self.orders):
            c, s = self.value[2 + 2 * k : 4 + 2 * k]
            speed = order * self.rate
            rate += speed * (s * np.cos(order * turn) - c * np.sin(order * turn))
            acceleration -= speed**2 * (c * np.cos(order * turn) + s * np.sin(order * turn))
        return rate, acceleration

    def uncertain(self, time: Array) -> Array:
        """Independent errors (n, 6) of the angle, rad of one standard deviation: of phase, rate and the low orders together."""
        count = 2 + 2 * len(LOW_ORDERS)
        root = np.linalg.cholesky(self.covariance[:count, :count])
        return _rows(time - self.middle, self.value[:2], LOW_ORDERS) @ root


def _rows(since: Array, line: Array, orders: Sequence[int]) -> Array:
    turn = line[0] + line[1] * since
    waves = [wave(order * turn) for order in orders for wave in (np.cos, np.sin)]
    return np.column_stack([np.ones_like(since), since, *waves])


def _solved(since: Array, angle: Array, line: Array, orders: Sequence[int]) -> tuple[Array, Array]:
    """Rows and coefficients; the phases of the waves follow the line that is found beside them."""
    for _ in range(2):
        line = np.asarray(np.linalg.lstsq(_rows(since, line, orders), angle, rcond=None)[0][:2], dtype=np.float64)
    rows = _rows(since, line, orders)
    return rows, np.asarray(np.linalg.lstsq(rows, angle, rcond=None)[0], dtype=np.float64)


def fit_sweep(time: Array, angle: Array, begin_rad: float, end_rad: float) -> Sweep:
    """The sweep through readings (n,), s and rad, of whole turns from one angle to another.

    Waves of the angle beyond the low orders are taken one after the other, as long as chance does not explain them.

    Raises
    ------
    NotIdentified
        There are too few readings.
    """
    turns = abs(end_rad - begin_rad) / (2.0 * np.pi)
    if len(time) < FEWEST_READINGS * max(1.0, turns):
        text = f"{len(time)} readings of the encoder in {turns:g} turns, {FEWEST_READINGS} a turn are needed"
        raise NotIdentified(f"rotation: {text}; turn more slowly")
    middle = float(time.mean())
    since = time - middle
    line = np.asarray(np.polynomial.polynomial.polyfit(since, angle, 1), dtype=np.float64)
    highest = int(0.4 * len(time) / max(1.0, turns))
    orders: list[int] = list(LOW_ORDERS)
    while True:
        rows, value = _solved(since, angle, line, orders)
        line = value[:2]
        rest = angle - rows @ value
        variance = max(float(rest @ rest) / (len(time) - rows.shape[1]), 1e-18)
        others = [k for k in range(1, highest + 1) if k not in orders]
        turn = line[0] + line[1] * since
        size = np.abs(np.exp(-1j * np.outer(others, turn)) @ rest) ** 2 / (len(time) * variance)
        best = int(np.argmax(size))
        if len(others) * np.exp(-size[best]) > WAVE_P or len(orders) == len(LOW_ORDERS) + MOST_WAVES:
            break
        orders.append(others[best])
    covariance = variance * np.linalg.inv(rows.T @ rows)
    at = [float(middle + (edge - value[0]) / value[1]) for edge in (begin_rad, end_rad)]
    return Sweep(middle, value, tuple(orders), covariance, float(np.sqrt(variance)), *at)


def parts_of(time: Array, angle: Array, ends: Sequence[float], turns: int, stand_s: float) -> tuple[list[Sweep], Array]:
    """Sweeps of a record, and the intervals (len(ends), 3) in which the axis stood: begin and end in s, angle in rad.

    Parameters
    ----------
    time, angle : readings (n,), s and rad
    ends : commanded angles at which it stands, in order, rad; turns : whole turns between two of them
    stand_s : time at each end
    """
    sweeps: list[Sweep] = []
    still: list[tuple[float, float, float]] = []
    centre, half = 0.5 * (ends[0] + ends[1]), np.pi * turns
    first = 0
    for k, end in enumerate(ends):
        near = np.flatnonzero(np.abs(angle[first:] - end) < NEAR) + first
        if k + 1 < len(ends):
            far = np.flatnonzero(np.abs(angle[first:] - ends[k + 1]) < NEAR) + first
            near = near[near < (far[0] if far.size else 0)]
            inside = np.arange(near[-1] if near.size else first, far[0] if far.size else first)
            inside = inside[np.abs(angle[inside] - centre) <= half]
            sign = 1.0 if ends[k + 1] > end else -1.0
            sweeps.append(fit_sweep(time[inside], angle[inside], centre - sign * half, centre + sign * half))
            first = far[0]
        if not near.size:
            raise NotIdentified(f"rotation: the encoder does not show {np.degrees(end):g}°, where the axis stood")
        last = float(time[near[-1]]) - LEAVING_S
        still.append((last - stand_s + LEAVING_S, last, float(np.mean(angle[near]))))
    return sweeps, np.array(still)
