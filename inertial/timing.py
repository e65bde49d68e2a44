"""What a station takes time for, in closed form: air that ramps, devices that follow it, the soak rule, moves of the table.

Plans, follow-ups and the time that is left use these; the simulated plant does not: it is the truth that they are held against.
"""

import math
from collections import deque
from dataclasses import dataclass
from functools import lru_cache

POLL_S = 0.25
"""How often the table is asked whether it stands."""


@dataclass(frozen=True)
class Air:
    """How temperatures follow a set point: ``ramp`` of the air, K/s, and ``lag`` of the slowest device behind it, s."""

    ramp: float
    lag: float


@dataclass(frozen=True)
class SoakRule:
    """When a soak counts as reached: all of ``window`` s inside ``band`` K, its halves apart by less than ``rate`` K/s allows.

    ``poll`` : s between looks; ``limit`` : s after the shortest soak when it is given up
    """

    band: float
    rate: float
    window: float
    limit: float
    poll: float


def followed(air: float, device: float, target: float, seconds: float, pace: Air) -> tuple[float, float]:
    """Air and device in °C some seconds later: exact for a ramp that ends at the target, and a lag of first order behind it."""
    ramping = min(seconds, abs(target - air) / pace.ramp)
    slope = math.copysign(pace.ramp, target - air)
    far = slope * pace.lag  # how far the device is behind a ramp that never ends
    behind = far + (air - device - far) * math.exp(-ramping / pace.lag)
    behind *= math.exp(-(seconds - ramping) / pace.lag)
    air = target if ramping < seconds else air + slope * ramping
    return air, air - behind


def settling_s(air: float, device: float, target: float, band: float, pace: Air) -> float:
    """Seconds until the air stands at the target and the device is within ``band`` K of it for good."""
    ramping = abs(target - air) / pace.ramp
    left = abs(target - followed(air, device, target, ramping, pace)[1])
    return ramping + pace.lag * math.log(max(left / band, 1.0))


@dataclass(frozen=True)
class Drive:
    """How the table moves: °/s, °/s², and s from the end of a move until the drive says that it stands."""

    speed: float
    acceleration: float
    in_position: float

    def seconds(self, way: float) -> float:
        """Seconds from the command to a move over so many degrees until both axes say that they stand, as they are asked."""
        return math.ceil((axis_seconds(way, self.speed, self.acceleration) + self.in_position) / POLL_S) * POLL_S


@lru_cache(maxsize=4096)
def soaked(air: float, device: float, target: float, shortest: float, pace: Air, rule: SoakRule) -> tuple[float, float]:
    """Seconds of a soak by a station's rule, and the device's temperature at its end.

    The rule is :meth:`stations.station.Station.soak`'s. A soak that never settles is given up as the station would.
    """
    past: deque[float] = deque([device], maxlen=round(rule.window / rule.poll) + 1)
    waited = 0.0
    while waited < shortest or not _settled(past, target, rule):
        if waited > shortest + rule.limit:
            break
        waited += rule.poll
        air, device = followed(air, device, target, rule.poll, pace)
        past.append(device)
    return waited, device


def _settled(past: deque[float], target: float, rule: SoakRule) -> bool:
    span = (len(past) - 1) * rule.poll
    if span < rule.window - 1.5 * rule.poll:
        return False
    rows = list(past)
    half = len(rows) // 2
    drift = abs(sum(rows[half:]) / (len(rows) - half) - sum(rows[:half]) / half)
    return max(abs(t - target) for t in rows) <= rule.band and drift / (span / 2.0) <= rule.rate


def axis_seconds(way: float, speed: float, acceleration: float) -> float:
    """Seconds of a trapezoidal move over a ``way``, in the angle of speed and acceleration."""
    ramp = min(speed / acceleration, math.sqrt(way / acceleration))
    return 0.0 if ramp == 0.0 else ramp + way / (acceleration * ramp)
