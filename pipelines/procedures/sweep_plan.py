"""The part of a recipe for a sweep: frequencies, levels, uncertainties and the model that is judged."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from inertial.dynamics import exciter
from inertial.dynamics.transfer_effects import EFFECTS
from pipelines.procedures.base import Part, refuse_unknown_effects
from schemas.bounds import NotNegative, Positive

FEWEST_POINTS = 8


class SweepPart(Part):
    """Frequencies in steps of a fraction of an octave, the level as far as stroke and velocity of the exciter allow.

    Uncertainties are standard ones: ``reference_percent`` is common to all points, ``repeatability_percent`` and
    ``repeatability_deg`` are each point's own. ``transverse_percent`` is the largest transverse sensitivity of the device.
    ``effects`` is the model to be judged; its diagnosis recommends others where it is not good enough.
    """

    kind: Literal["sweep"]
    low_hz: Annotated[Positive, Field(ge=0.5)] = 5.0
    high_hz: Annotated[Positive, Field(le=10000.0)] = 1000.0
    per_octave: Annotated[int, Field(ge=1, le=24)] = 6
    frequencies_hz: Annotated[list[Positive], Field(max_length=400)] = Field(default_factory=list[float])
    level_g: Annotated[Positive, Field(le=50.0)] = 0.5
    other_levels_g: Annotated[list[Positive], Field(max_length=10)] = Field(default_factory=list[float])
    level_frequency_hz: Positive = 160.0
    axis: Literal["x", "y", "z"] = "z"
    cycles: Annotated[int, Field(ge=3, le=1000)] = 20
    record_s: Annotated[Positive, Field(le=60.0)] = 0.25
    temperature_C: Annotated[float, Field(ge=-100.0, le=200.0)] = 25.0
    stroke_mm: Positive = 12.0
    velocity_m_s: Positive = 1.4
    reference_percent: NotNegative = 0.25
    repeatability_percent: NotNegative = 0.1
    repeatability_deg: NotNegative = 0.06
    transverse_percent: NotNegative = 0.3
    flat_to_hz: Positive | None = None
    nominal_scale: Positive | None = None
    bandwidth_order: Annotated[int, Field(ge=1, le=8)] = 2
    effects: Annotated[list[str], Field(min_length=1, max_length=6)] = Field(
        default_factory=lambda: ["second_order", "delay"]
    )

    @model_validator(mode="after")
    def _usable(self) -> SweepPart:
        if self.low_hz >= self.high_hz:
            raise ValueError(f"low_hz: {self.low_hz:g} Hz is not below high_hz, {self.high_hz:g} Hz; correct one")
        refuse_unknown_effects(self.effects, EFFECTS, "sweeps")
        if len(self.plan()) < FEWEST_POINTS:
            raise ValueError(
                f"per_octave: {len(self.plan())} points, at least {FEWEST_POINTS} are needed; raise "
                f"per_octave, or widen the range"
            )
        return self

    def plan(self) -> list[tuple[float, float]]:
        """Frequency in Hz and level in g of every point, in order of frequency; those at other levels last."""
        count = int(np.floor(self.per_octave * np.log2(self.high_hz / self.low_hz) + 1e-9)) + 1
        grid = self.frequencies_hz or [float(self.low_hz * 2.0 ** (k / self.per_octave)) for k in range(count)]
        reach = exciter.largest_level(
            grid, displacement_m=1e-3 * self.stroke_mm, velocity_m_s=self.velocity_m_s, acceleration_g=self.level_g
        )
        return [*zip(grid, reach.tolist(), strict=True), *((self.level_frequency_hz, g) for g in self.other_levels_g)]

    def lasting(self, frequency: float) -> float:
        """Duration of the record of a point, s: the shortest that is allowed, or the number of cycles."""
        return max(self.record_s, self.cycles / frequency)
