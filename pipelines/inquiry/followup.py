"""A follow-up: proposed steps as a recipe that the station can measure, and what they cost there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from inertial.criticism.menus import Reach
from inertial.criticism.proposals import Circumstances
from inertial.planning.sequences import SequenceStep as Wanted
from inertial.planning.sequences import StationPace
from pipelines.jobs.job import Job
from pipelines.schedule.steps import Step, steps
from pipelines.schedule.timing import StationPose, drive_of, lag_of, minutes, rule_of
from schemas.recipe import Pose, Recipe, SoakPart
from stations.profile_files import profile_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

VARIED_K = 5.0


@dataclass(frozen=True)
class StationState:
    """Where a station goes on from, after a run.

    pose, temperature : of its last record; at_once : whether it still stands there: hardware is left in its safe state
    """

    pose: Pose
    temperature: float
    at_once: bool

    def step(self) -> Wanted:
        """The same for the science."""
        outer, inner = np.radians([self.pose.outer_deg, self.pose.inner_deg])
        return Wanted(float(outer), float(inner), self.temperature)


def place_after(job: Job) -> StationState:
    """Where the station stands when the last record of a job is taken."""
    last = steps(job.recipe)[-1]
    safe = job.station.safety
    simulated = job.station.kind == "simulated"
    temperature = last.temperature if simulated or safe.chamber == "hold" else safe.temperature_C
    return StationState(last.pose, temperature, simulated)


def circumstances(base: Job, last: Job, budget: float) -> Circumstances:
    """What a follow-up may use: the station's reach and pace, its time for steps, and the minutes that are left.

    Parameters
    ----------
    base : the first job of the lineage, for the temperatures that the device is calibrated at
    last : the newest one; the station stands where it ended
    budget : min
    """
    station, recipe, place = base.station, base.recipe, place_after(last)
    limits = station.limits
    low, high = min(recipe.temperatures_C), max(recipe.temperatures_C)
    reach = Reach(
        outer=_radians(limits.outer_deg),
        inner=_radians(limits.inner_deg),
        temperature=(low, high) if high - low > VARIED_K else None,
        settle=recipe.settle_s,
        power=profile_of(station.devices.reader).has("power"),
    )
    pace = StationPace(
        dwell_s=recipe.dwell_s,
        overhead_s=station.pace.record_s,
        ramp=station.pace.ramp_K_per_min / 60.0,
        lag=lag_of(station),
        soak_s=recipe.soak_min_s,
        rule=rule_of(station),
        drive=drive_of(station),
        start=place.step(),
    )
    return Circumstances(reach, pace, lambda wanted: station_minutes(wanted, base, place), budget)


def station_minutes(wanted: Sequence[Wanted], base: Job, place: StationState) -> float:
    """Station time of steps from where the station stands, min."""
    if not wanted:
        return 0.0
    parts = _parts(wanted, place)
    plan: list[Step] = []
    for soak, part in enumerate(parts):
        settled = _settled(soak, part, place)
        plan += [
            Step(len(plan) + k, "dwell", soak, s.temperature, pose_of(s), s.wait, settled, s.off)
            for k, s in enumerate(part)
        ]
    start = StationPose(place.pose.outer_deg, place.pose.inner_deg, place.temperature, place.temperature)
    return minutes(plan, base.station, base.recipe, start).total


def follow_up(wanted: Sequence[Wanted], base: Job, last: Job, parents: Sequence[str], why: str) -> Job:
    """The job that measures steps only, on the same station and lot, from where the newest run ended."""
    place = place_after(last)
    poses: dict[tuple[float, float], Pose] = {}
    for step in wanted:
        plain = pose_of(step)
        key = (plain.outer_deg, plain.inner_deg)
        poses.setdefault(key, plain.model_copy(update={"name": f"n{len(poses) + 1:03d}"}))
    numbers = {key: k for k, key in enumerate(poses, start=1)}
    soaks = [
        SoakPart(
            temperature_C=part[0].temperature,
            poses=[numbers[_key(s)] for s in part],
            verification=[],
            waits_s=[round(s.wait, 1) for s in part],
            off_s=[round(s.off, 1) for s in part] if any(s.off > 0.0 for s in part) else None,
            settled=_settled(k, part, place),
        )
        for k, part in enumerate(_parts(wanted, place))
    ]
    changes = {
        "name": f"{base.recipe.name}-next{len(parents)}",
        "description": why,
        "poses": list(poses.values()),
        "verification": [],
        "soaks": soaks,
        "temperatures_C": [s.temperature_C for s in soaks],
        "static_record_s": 0.0,
        "static_temperature_C": soaks[-1].temperature_C,
    }
    recipe = Recipe.model_validate({**base.recipe.model_dump(), **_dumped(changes)})
    return Job(recipe, base.limits, base.lot, base.station, parents=tuple(parents))


def _dumped(changes: Mapping[str, object]) -> dict[str, object]:
    """Models among the changes as plain values: what goes through validation is what a file would hold."""
    return {key: _plain(value) for key, value in changes.items()}


def _plain(value: object) -> object:
    if isinstance(value, list):
        return [_plain(item) for item in cast("list[object]", value)]
    return value.model_dump() if isinstance(value, Pose | SoakPart) else value


def _parts(wanted: Sequence[Wanted], place: StationState) -> list[list[Wanted]]:
    """Steps by soak: a new one where the temperature changes."""
    del place
    parts: list[list[Wanted]] = []
    for step in wanted:
        if parts and parts[-1][0].temperature == step.temperature:
            parts[-1].append(step)
        else:
            parts.append([step])
    return parts


def _settled(number: int, part: Sequence[Wanted], place: StationState) -> bool:
    """Whether the devices must settle first: not where they stand settled there already, nor where they are read on the way."""
    there = number == 0 and place.at_once and abs(part[0].temperature - place.temperature) < 0.5
    return part[0].soaked and not there


def pose_of(step: Wanted) -> Pose:
    """The pose of a step, without a name worth having."""
    outer, inner = _key(step)
    return Pose(name="next", outer_deg=outer, inner_deg=inner)


def _key(step: Wanted) -> tuple[float, float]:
    return round(float(np.degrees(step.outer)), 4) + 0.0, round(float(np.degrees(step.inner)), 4) + 0.0


def _radians(bounds: tuple[float, float]) -> tuple[float, float]:
    low, high = np.radians(bounds)
    return float(low), float(high)
