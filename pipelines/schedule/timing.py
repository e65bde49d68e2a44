"""Station time of a recipe, or of any steps: moves, soaks, dwells and the static record, before any of it is spent."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, get_args

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.schedule.steps import Step
    from schemas.recipe import Pose, Recipe
    from schemas.station import StationConfig

ActivityKind = Literal["soak", "move", "dwell", "verification", "allan"]

_POLL_S = 0.25
"""How often the table is asked whether it stands."""

_FIRST_SOAK = -1


@dataclass(frozen=True)
class Minutes:
    """Station time in minutes, by what it goes into."""

    moves: float
    soaks: float
    dwells: float
    static_record: float

    @property
    def total(self) -> float:
        """All of it."""
        return self.moves + self.soaks + self.dwells + self.static_record

    def document(self) -> dict[str, float]:
        """The parts and their sum, rounded, by name."""
        parts = {"soaks": self.soaks, "moves": self.moves, "dwells": self.dwells, "static_record": self.static_record}
        return {**{k: round(v, 2) for k, v in parts.items()}, "total": round(self.total, 2)}


@dataclass(frozen=True)
class StationPose:
    """Where a station stands: table in degrees, air and slowest device in °C, and the soak that it has reached."""

    outer: float = 0.0
    inner: float = 0.0
    air: float = 23.0
    device: float = 23.0
    soak: int = _FIRST_SOAK


@dataclass(frozen=True)
class Activity:
    """One thing that a station does for a step: from ``start`` s on for ``seconds``; air and device as it begins and ends."""

    kind: ActivityKind
    step: Step
    start: float
    seconds: float
    begin: StationPose
    end: StationPose


def minutes(steps: Sequence[Step], station: StationConfig, recipe: Recipe, start: StationPose | None = None) -> Minutes:
    """Station time of steps in order; a change of their ``soak`` is a soak, as capture does it.

    Parameters
    ----------
    steps : records to take, of a recipe (:func:`pipelines.capture.capture.steps`) or any others
    station : its speeds, its rule for soaks and its pace
    recipe : for the shortest soak, the settling after a move and the durations
    start : where the station stands; in the room, level and not soaked where None
    """
    return spent(schedule(steps, station, recipe, start))


def spent(stretches: Sequence[Activity]) -> Minutes:
    """Station time of what a station does."""
    total = dict.fromkeys(get_args(ActivityKind), 0.0)
    for stretch in stretches:
        total[stretch.kind] += stretch.seconds / 60.0
    return Minutes(total["move"], total["soak"], total["dwell"] + total["verification"], total["allan"])


def schedule(
    steps: Sequence[Step], station: StationConfig, recipe: Recipe, start: StationPose | None = None
) -> list[Activity]:
    """What a station does for steps in order: soaks, moves with their settling, records; see :func:`minutes`."""
    room = station.simulation.room_C if station.simulation else station.pace.room_C
    now, clock = start or StationPose(air=room, device=room), 0.0
    found: list[Activity] = []
    for step in steps:
        begin = now
        parts: list[tuple[ActivityKind, float, StationPose]] = []
        if step.soak != now.soak and not step.settled:
            now = replace(now, soak=step.soak)  # read on the way: nobody waits
        elif step.soak != now.soak:
            waited, reached = soaked(now, step.temperature, station, recipe.soak_min_s)
            parts.append(("soak", waited, replace(reached, soak=step.soak)))
            now = parts[-1][2]
        wait = recipe.settle_s if step.wait_s is None else step.wait_s
        going = step.off_s + move_seconds(now, step.pose, station) + wait + station.pace.record_s
        there = replace(
            _later(now, step.temperature, going, station), outer=step.pose.outer_deg, inner=step.pose.inner_deg
        )
        lasting = recipe.static_record_s if step.kind == "allan" else recipe.dwell_s
        parts.append(("move", going, there))
        parts.append((step.kind, lasting, _later(there, step.temperature, lasting, station)))
        for what, seconds, end in parts:
            found.append(Activity(what, step, clock, seconds, begin, end))
            clock, begin = clock + seconds, end
        now = begin
    return found


def temperatures(stretches: Sequence[Activity], station: StationConfig) -> list[tuple[float, float, float]]:
    """Time in s, air and slowest device in °C along what a station does, as often as it looks at a soak.

    What a settled device is still away from its target is no temperature that a plan may count on: it is taken off.
    """
    thermal = _thermal(station)
    found: list[tuple[float, float, float]] = []
    for stretch in stretches:
        target = stretch.step.temperature
        air, device = stretch.begin.air, stretch.begin.device
        if stretch.kind != "soak":
            found.append((stretch.start, target, target) if stretch.step.settled else (stretch.start, air, device))
            continue
        ends = (found[-1][2] - device if found else 0.0, target - stretch.end.device)
        count = math.ceil(stretch.seconds / thermal.poll)
        for k in range(count):
            part = k / count
            found.append((stretch.start + k * thermal.poll, air, device + (1.0 - part) * ends[0] + part * ends[1]))
            air, device = _followed(air, device, target, thermal.poll, thermal)
    last = stretches[-1]
    target = last.step.temperature
    air, device = (target, target) if last.step.settled else (last.end.air, last.end.device)
    return [*found, (last.start + last.seconds, air, device)]


def move_seconds(now: StationPose, pose: Pose, station: StationConfig) -> float:
    """Seconds from the command to a pose until both axes say that they stand there."""
    limits = station.limits
    way = max(abs(pose.outer_deg - now.outer), abs(pose.inner_deg - now.inner))
    going = axis_seconds(way, limits.speed_deg_s, limits.acceleration_deg_s2) + station.pace.in_position_s
    return math.ceil(going / _POLL_S) * _POLL_S


def axis_seconds(way: float, speed: float, acceleration: float) -> float:
    """Seconds of a trapezoidal move over ``way`` degrees."""
    ramp = min(speed / acceleration, math.sqrt(way / acceleration))
    return 0.0 if ramp == 0.0 else ramp + way / (acceleration * ramp)


def soaked(now: StationPose, target: float, station: StationConfig, shortest: float) -> tuple[float, StationPose]:
    """Seconds until the slowest device has settled at ``target`` °C by the station's rule, and how it stands then."""
    waited, device = _soak(now.air, now.device, target, shortest, _thermal(station))
    return waited, replace(now, air=target, device=device)


@dataclass(frozen=True)
class _Thermal:
    """Pace of chamber and devices, and the rule by which a soak counts as reached."""

    lag: float
    ramp: float
    band: float
    rate: float
    window: float
    limit: float
    poll: float


def _thermal(station: StationConfig) -> _Thermal:
    rule, ramp = station.soak, station.pace.ramp_K_per_min / 60.0
    return _Thermal(
        lag_of(station), ramp, rule.band_K, rule.rate_K_per_min / 60.0, rule.window_s, rule.limit_s, rule.poll_s
    )


def lag_of(station: StationConfig) -> float:
    """Seconds by which the slowest device follows the chamber's air."""
    return station.simulation.slot_lag_s[1] if station.simulation else station.pace.lag_s


@lru_cache(maxsize=4096)
def _soak(air: float, device: float, target: float, shortest: float, thermal: _Thermal) -> tuple[float, float]:
    """Seconds, and the device's temperature at the end: air ramps to the target, the device follows with its lag.

    The rule is :meth:`stations.station.Station.soak`'s: all of the window inside the band, and its halves apart by less than
    the rate allows. A soak that never settles is given up as the station would.
    """
    past: deque[float] = deque([device], maxlen=round(thermal.window / thermal.poll) + 1)
    waited = 0.0
    while waited < shortest or not _settled(past, target, thermal):
        if waited > shortest + thermal.limit:
            break
        air, device = _followed(air, device, target, thermal.poll, thermal)
        past.append(device)
        waited += thermal.poll
    return waited, device


def _settled(past: deque[float], target: float, thermal: _Thermal) -> bool:
    span = (len(past) - 1) * thermal.poll
    if span < thermal.window - 1.5 * thermal.poll:
        return False
    rows = list(past)
    half = len(rows) // 2
    drift = abs(sum(rows[half:]) / (len(rows) - half) - sum(rows[:half]) / half)
    return max(abs(t - target) for t in rows) <= thermal.band and drift / (span / 2.0) <= thermal.rate


def _followed(air: float, device: float, target: float, seconds: float, thermal: _Thermal) -> tuple[float, float]:
    """Air and device some seconds later: exact for a ramp that ends at the target, and a lag of first order behind it."""
    ramping = min(seconds, abs(target - air) / thermal.ramp)
    slope = math.copysign(thermal.ramp, target - air)
    far = slope * thermal.lag  # how far the device is behind a ramp that never ends
    behind = far + (air - device - far) * math.exp(-ramping / thermal.lag)
    behind *= math.exp(-(seconds - ramping) / thermal.lag)
    air = target if ramping < seconds else air + slope * ramping
    return air, air - behind


def _later(now: StationPose, target: float, seconds: float, station: StationConfig) -> StationPose:
    """How the station stands some seconds later, while its air is at ``target`` °C or on the way there."""
    air, device = _followed(now.air, now.device, target, seconds, _thermal(station))
    return replace(now, air=air, device=device)
