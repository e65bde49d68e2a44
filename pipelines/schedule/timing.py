"""Station time of a recipe, or of any steps: moves, soaks, dwells and the static record, before any of it is spent."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

from inertial import timing
from pipelines.schedule.steps import Step
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.station import StationConfig

ActivityKind = Literal["soak", "move", "dwell", "verification", "allan", "procedure"]

_FIRST_SOAK = -1


@dataclass(frozen=True)
class Minutes:
    """Station time in minutes, by what it goes into."""

    moves: float
    soaks: float
    dwells: float
    static_record: float
    procedures: float = 0.0

    @property
    def total(self) -> float:
        """The whole station time, min."""
        return self.moves + self.soaks + self.dwells + self.static_record + self.procedures

    def document(self) -> dict[str, float]:
        """The parts and their sum, rounded, by name."""
        parts = {"soaks": self.soaks, "moves": self.moves, "dwells": self.dwells, "static_record": self.static_record}
        if self.procedures > 0.0:
            parts["procedures"] = self.procedures
        return {**{k: round(v, 2) for k, v in parts.items()}, "total": round(self.total, 2)}


@dataclass(frozen=True)
class StationPose:
    """The state of a station: table in degrees, air and slowest device in °C, and the soak that it has reached."""

    outer: float = 0.0
    inner: float = 0.0
    air: float = 23.0
    device: float = 23.0
    soak: int = _FIRST_SOAK


@dataclass(frozen=True)
class Activity:
    """An activity of a station for a step: from ``start`` s on for ``seconds``; air and device as it begins and ends."""

    kind: ActivityKind
    step: Step
    start: float
    seconds: float
    begin: StationPose
    end: StationPose


def minutes(steps: Sequence[Step], station: StationConfig, recipe: Recipe, start: StationPose | None = None) -> Minutes:
    """Station time of steps in order; a change of their ``soak`` is a soak, as capture does it.

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
    dwells = total["dwell"] + total["verification"]
    return Minutes(total["move"], total["soak"], dwells, total["allan"], total["procedure"])


def schedule(
    steps: Sequence[Step], station: StationConfig, recipe: Recipe, start: StationPose | None = None
) -> list[Activity]:
    """The activities of a station for steps in order: soaks, moves with their settling, records; see :func:`minutes`."""
    room = station.simulation.room_C if station.simulation else station.pace.room_C
    now, clock = start or StationPose(air=room, device=room), 0.0
    activities: list[Activity] = []
    for step in steps:
        begin = now
        parts: list[tuple[ActivityKind, float, StationPose]] = []
        if step.soak != now.soak and not step.settled:
            now = replace(now, soak=step.soak)  # measured during the change of temperature, without a wait
        elif step.soak != now.soak:
            waited, reached = soaked(now, step.temperature, station, recipe.soak_min_s)
            parts.append(("soak", waited, replace(reached, soak=step.soak)))
            now = parts[-1][2]
        wait = recipe.settle_s if step.wait_s is None else step.wait_s
        going = step.off_s + move_seconds(now, step.pose, station) + wait + station.pace.record_s
        there = replace(
            _later(now, step.temperature, going, station), outer=step.pose.outer_deg, inner=step.pose.inner_deg
        )
        lasting = step.lasts(recipe)
        parts.append(("move", going, there))
        parts.append((step.kind, lasting, _later(there, step.temperature, lasting, station)))
        for what, seconds, end in parts:
            activities.append(Activity(what, step, clock, seconds, begin, end))
            clock, begin = clock + seconds, end
        now = begin
    return activities


def temperatures(stretches: Sequence[Activity], station: StationConfig) -> list[tuple[float, float, float]]:
    """Time in s, air and slowest device in °C along what a station does, as often as it looks at a soak.

    What a settled device is still away from its target is no temperature that a plan may count on: it is taken off.
    """
    pace, poll = air_of(station), station.soak.poll_s
    points: list[tuple[float, float, float]] = []
    for stretch in stretches:
        target = stretch.step.temperature
        air, device = stretch.begin.air, stretch.begin.device
        if stretch.kind != "soak":
            points.append((stretch.start, target, target) if stretch.step.settled else (stretch.start, air, device))
            continue
        ends = (points[-1][2] - device if points else 0.0, target - stretch.end.device)
        count = math.ceil(stretch.seconds / poll)
        for k in range(count):
            part = k / count
            points.append((stretch.start + k * poll, air, device + (1.0 - part) * ends[0] + part * ends[1]))
            air, device = timing.followed(air, device, target, poll, pace)
    last = stretches[-1]
    target = last.step.temperature
    air, device = (target, target) if last.step.settled else (last.end.air, last.end.device)
    return [*points, (last.start + last.seconds, air, device)]


def move_seconds(now: StationPose, pose: Pose, station: StationConfig) -> float:
    """Seconds from the command to a pose until both axes say that they stand there."""
    way = max(abs(pose.outer_deg - now.outer), abs(pose.inner_deg - now.inner))
    return drive_of(station).seconds(way)


def soaked(now: StationPose, target: float, station: StationConfig, shortest: float) -> tuple[float, StationPose]:
    """Seconds until the slowest device has settled at ``target`` °C by the station's rule, and how it stands then."""
    waited, device = timing.soaked(now.air, now.device, target, shortest, air_of(station), rule_of(station))
    return waited, replace(now, air=target, device=device)


def air_of(station: StationConfig) -> timing.Air:
    """Pace of chamber and devices."""
    return timing.Air(station.pace.ramp_K_per_min / 60.0, lag_of(station))


def rule_of(station: StationConfig) -> timing.SoakRule:
    """The rule by which a soak counts as reached."""
    rule = station.soak
    return timing.SoakRule(rule.band_K, rule.rate_K_per_min / 60.0, rule.window_s, rule.limit_s, rule.poll_s)


def drive_of(station: StationConfig) -> timing.Drive:
    """Speed, acceleration and settling of the table."""
    limits = station.limits
    return timing.Drive(limits.speed_deg_s, limits.acceleration_deg_s2, station.pace.in_position_s)


def lag_of(station: StationConfig) -> float:
    """Seconds by which the slowest device follows the chamber's air."""
    return station.simulation.slot_lag_s[1] if station.simulation else station.pace.lag_s


def _later(now: StationPose, target: float, seconds: float, station: StationConfig) -> StationPose:
    """The state of the station some seconds later, while its air is at ``target`` °C or on the way there."""
    air, device = timing.followed(now.air, now.device, target, seconds, air_of(station))
    return replace(now, air=air, device=device)
