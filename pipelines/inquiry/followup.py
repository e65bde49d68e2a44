"""A follow-up: proposed steps as a recipe for the station, and their station time."""

from collections.abc import Sequence

import numpy as np

from inertial.next_measurement.menus import TableReach
from inertial.next_measurement.proposals import Circumstances
from inertial.planning.sequences import SequenceStep, StationPace
from pipelines.jobs.job import Job
from pipelines.schedule.steps import Step, steps
from pipelines.schedule.timing import StationPose, drive_of, lag_of, minutes, rule_of
from schemas.poses import Pose, SoakPart
from schemas.recipe import Recipe
from stations.profile_files import profile_of

VARIED_K = 5.0


def state_after(job: Job) -> StationPose:
    """Where the station stands after the last record of a job; hardware has returned to its safe state."""
    last = steps(job.recipe)[-1]
    safe = job.station.safety
    stays = job.station.kind == "simulated" or safe.chamber == "hold"
    temperature = last.temperature if stays else safe.temperature_C
    return StationPose(last.pose.outer_deg, last.pose.inner_deg, temperature, temperature)


def circumstances(base: Job, last: Job, budget: float) -> Circumstances:
    """Limits of a follow-up: reach and pace of the station, station time of steps, and the remaining budget.

    base : the first job of the lineage, for the calibration temperatures
    last : the newest job; the station continues from its end
    budget : min
    """
    station, recipe, now = base.station, base.recipe, state_after(last)
    limits = station.limits
    low, high = min(recipe.temperatures_C), max(recipe.temperatures_C)
    reach = TableReach(
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
        start=SequenceStep(*_radians((now.outer, now.inner)), now.air),
    )
    return Circumstances(reach, pace, lambda sequence: station_minutes(sequence, base, now), budget)


def station_minutes(sequence: Sequence[SequenceStep], base: Job, now: StationPose) -> float:
    """Station time of steps from where the station stands, min."""
    if not sequence:
        return 0.0
    parts = _parts(sequence)
    plan: list[Step] = []
    for soak, part in enumerate(parts):
        settled = _settled(soak, part, base, now)
        plan += [
            Step(len(plan) + k, "dwell", soak, s.temperature, pose_of(s), s.wait, settled, s.off)
            for k, s in enumerate(part)
        ]
    return minutes(plan, base.station, base.recipe, now).total


def follow_up(sequence: Sequence[SequenceStep], base: Job, last: Job, parents: Sequence[str], why: str) -> Job:
    """The job that measures only these steps, on the station and lot of the newest run, from its end on."""
    now = state_after(last)
    poses: dict[tuple[float, float], Pose] = {}
    for step in sequence:
        pose = pose_of(step)
        key = (pose.outer_deg, pose.inner_deg)
        poses.setdefault(key, pose.model_copy(update={"name": f"n{len(poses) + 1:03d}"}))
    numbers = {key: k for k, key in enumerate(poses, start=1)}
    soaks = [
        SoakPart(
            temperature_C=part[0].temperature,
            poses=[numbers[_key(s)] for s in part],
            verification=[],
            waits_s=[round(s.wait, 1) for s in part],
            off_s=[round(s.off, 1) for s in part] if any(s.off > 0.0 for s in part) else None,
            settled=_settled(k, part, base, now),
        )
        for k, part in enumerate(_parts(sequence))
    ]
    changes = {
        "name": f"{base.recipe.name}-next{len(parents)}",
        "description": why,
        "poses": list(poses.values()),
        "verification": [],
        "soaks": soaks,
        "temperatures_C": [s.temperature_C for s in soaks],
        "stop": None,
        "static_record_s": 0.0,
        "static_temperature_C": soaks[-1].temperature_C,
    }
    recipe = Recipe.model_validate(base.recipe.model_copy(update=changes).model_dump())
    return Job(recipe, base.limits, base.lot, base.station, parents=tuple(parents))


def _parts(sequence: Sequence[SequenceStep]) -> list[list[SequenceStep]]:
    """Steps by soak: a change of temperature starts a new soak."""
    parts: list[list[SequenceStep]] = []
    for step in sequence:
        if parts and parts[-1][0].temperature == step.temperature:
            parts[-1].append(step)
        else:
            parts.append([step])
    return parts


def _settled(number: int, part: Sequence[SequenceStep], base: Job, now: StationPose) -> bool:
    """Whether the devices must settle first: not where they are already settled, nor for dwells during a temperature change."""
    # a lot that ended early stands elsewhere than its plan ends
    stayed = number == 0 and base.station.kind == "simulated" and base.recipe.stop is None
    return part[0].soaked and not (stayed and abs(part[0].temperature - now.device) < 0.5)


def pose_of(step: SequenceStep) -> Pose:
    """The pose of a step, with a placeholder name."""
    outer, inner = _key(step)
    return Pose(name="next", outer_deg=outer, inner_deg=inner)


def _key(step: SequenceStep) -> tuple[float, float]:
    return round(float(np.degrees(step.outer)), 4) + 0.0, round(float(np.degrees(step.inner)), 4) + 0.0


def _radians(bounds: tuple[float, float]) -> tuple[float, float]:
    low, high = np.radians(bounds)
    return float(low), float(high)
