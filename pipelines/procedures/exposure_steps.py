"""The part of a recipe for an exposure, and its records: six poses before, during and after, and the legs of the profile."""

from collections.abc import Iterator
from functools import cached_property
from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipelines.procedures.base import Celsius, NominalScale
from pipelines.procedures.climate import MINUTE_S, Leg, leg_step
from pipelines.procedures.recorded import ProcedureStep
from schemas.bounds import Positive
from schemas.errors import RecipeInvalid
from schemas.exposure_profile import (
    AMBIENT_HPA,
    ExposureLeg,
    ExposureProfile,
    Pressure,
    exposure_profiles,
    load_exposure_profile,
)
from schemas.poses import Pose

FACES = {
    "+z": (0.0, 0.0),
    "-z": (180.0, 0.0),
    "+y": (90.0, 0.0),
    "-y": (90.0, 180.0),
    "+x": (90.0, 90.0),
    "-x": (90.0, -90.0),
}
BEFORE, BETWEEN, AFTER = "before", "exposure", "after"
DRY = "dry"
"""Poses at the temperatures of the exposure, in the air of the room before it."""
SAME_K = 1.0
"""Within which two temperatures are one."""


class ExposurePart(NominalScale):
    """A ``profile`` between two measurements of six poses, each of ``window_s`` and ``repeats`` times, at ``temperature_C``.

    ``cycles``, ``low_C``, ``high_C`` and ``pressure_hPa`` are those of the profile where they are left out; a profile of shocks
    or rates has no temperatures of its own. At the temperatures of a profile with humidity or pressure the poses are also
    measured in the air of the room before it, and ``around_K`` from ``temperature_C`` where none of them lies on that side.
    """

    kind: Literal["exposure"]
    profile: str = "temperature_variation"
    low_C: Celsius | None = None
    high_C: Celsius | None = None
    pressure_hPa: Pressure | None = None
    cycles: Annotated[int, Field(ge=1, le=100)] | None = None
    repeats: Annotated[int, Field(ge=2, le=20)] = 2
    window_s: Annotated[Positive, Field(ge=2.0, le=600.0)] = 10.0
    around_K: Annotated[Positive, Field(ge=2.0, le=50.0)] = 10.0

    @model_validator(mode="after")
    def _complete(self) -> "ExposurePart":
        if self.profile not in exposure_profiles():
            raise ValueError(
                f"no exposure profile '{self.profile}', {', '.join(exposure_profiles())} are there; choose one"
            )
        profile = self.stated
        for key in ("low_C", "high_C", "pressure_hPa"):
            stated, used = getattr(self, key) is not None, key in profile.levels()
            if stated and not used:
                raise ValueError(f"{key}: profile {self.profile} has no such level; leave it out")
            if used and not stated and getattr(profile, key) is None:
                raise ValueError(f"{key}: missing, profile {self.profile} has none of its own; state it")
        low, high = self.level("low_C"), self.level("high_C")
        if low is not None and high is not None and not low < high:
            raise ValueError(f"low_C: {low:g} °C, below high_C ({high:g} °C) is needed; exchange them")
        return self

    @cached_property
    def stated(self) -> ExposureProfile:
        """The profile as it is stored."""
        return load_exposure_profile(self.profile)

    def level(self, key: str) -> float | None:
        """A level of the recipe, or else of the profile."""
        ordered: float | None = getattr(self, key)
        return getattr(self.stated, key) if ordered is None else ordered

    def temperature_of(self, leg: ExposureLeg) -> float:
        """Temperature of a leg, °C."""
        found = self.temperature_C if leg.temperature == "rest" else self.level(f"{leg.temperature}_C")
        if found is None:
            raise RecipeInvalid(f"recipe: exposure: {leg.temperature}_C is missing; state it", key="low_C")
        return found

    def legs(self) -> Iterator[tuple[str, ExposureLeg, Leg]]:
        """The legs of all cycles, with their names; a change at a rate begins at the temperature of the leg before."""
        at = self.temperature_C
        for cycle in range(self.cycles or self.stated.cycles):
            for number, leg in enumerate(self.stated.legs):
                to = self.temperature_of(leg)
                minutes = leg.change_min or (abs(to - at) / leg.K_per_min if leg.K_per_min else 0.0)
                pressure = self.level("pressure_hPa") if leg.low_pressure else AMBIENT_HPA
                yield (
                    f"{leg.temperature} {cycle + 1}.{number + 1}",
                    leg,
                    Leg(to, leg.humidity_pct, pressure or AMBIENT_HPA, MINUTE_S * minutes, MINUTE_S * leg.hold_min),
                )
                at = to

    def dry(self) -> list[float]:
        """Temperatures at which the poses are measured in the air of the room before the exposure."""
        if not self.stated.conditioned:
            return []
        measured = {self.temperature_of(leg) for leg in self.stated.legs if leg.measured}
        others = [degrees for degrees in sorted(measured) if abs(degrees - self.temperature_C) > SAME_K]
        below = [] if any(degrees < self.temperature_C for degrees in others) else [self.temperature_C - self.around_K]
        above = [] if any(degrees > self.temperature_C for degrees in others) else [self.temperature_C + self.around_K]
        return [*below, *others, *above]

    def temperatures(self) -> dict[str, float]:
        """Every temperature that is asked for, by the key that states it."""
        keys = {key: self.level(key) for key in ("low_C", "high_C")}
        return {
            **{key: value for key, value in keys.items() if value is not None and key in self.stated.levels()},
            "temperature_C": self.temperature_C,
            **{f"{degrees - self.temperature_C:+g} K from temperature_C:": degrees for degrees in self.dry()},
        }


def steps_of(part: ExposurePart) -> list[ProcedureStep]:
    """Poses in the room's air, before, legs with poses at their ends, recovery, poses after, always in the same order."""
    steps: list[ProcedureStep] = []

    def poses(when: str, at: float, times: int = 1) -> None:
        soak = steps[-1].soak + 1 if steps else 0
        steps.extend(
            ProcedureStep(
                f"{when} {face}",
                Pose(name=f"{when.replace(' ', '').replace('.', '_')}{k}", outer_deg=outer, inner_deg=inner),
                at,
                lasting_s=part.window_s,
                soak=soak,
            )
            for k, (face, (outer, inner)) in enumerate(list(FACES.items()) * times)
        )

    for at in part.dry():
        poses(f"{DRY} {at:g}", at)
    poses(BEFORE, part.temperature_C, part.repeats)
    change_s = MINUTE_S
    for name, stated, leg in part.legs():
        if stated.by_unit:
            steps.append(leg_step(name, leg, steps[-1].soak + 1))
            change_s = max(change_s, leg.change_s)
        if stated.measured:
            poses(name, leg.temperature_C)
    if part.stated.by_unit:
        hold_s = MINUTE_S * part.stated.recovery_min
        rest = Leg(part.temperature_C, None, AMBIENT_HPA, change_s, hold_s)
        steps.append(leg_step("recovery", rest, steps[-1].soak + 1))
    poses(AFTER, part.temperature_C, part.repeats)
    return steps
