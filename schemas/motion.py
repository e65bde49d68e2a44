"""Limits of an exciter's motion: displacement, velocity, acceleration, and what a sine or a random profile asks of them."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

from pydantic import Field

from schemas.bounds import Number
from schemas.strict import Strict
from schemas.units import STANDARD_GRAVITY_M_S2

PEAK_FACTOR = 3.0  # peaks of Gaussian vibration that the exciter must follow, over the rms: drives are clipped there
PARTS = 200  # of a straight segment of a profile, for its integral

Limit = Annotated[Number, Field(gt=0.0)]


class Motion(Strict):
    """Largest peak displacement in mm from the middle, velocity in m/s and acceleration in g; without a limit where left out."""

    displacement_mm: Limit | None = None
    velocity_m_s: Limit | None = None
    acceleration_g: Limit | None = None

    def tighter(self, other: "Motion") -> "Motion":
        """The smaller limit of both, each by itself."""
        mine, its = self.model_dump(), other.model_dump()
        return Motion(**{k: min((v for v in (mine[k], its[k]) if v is not None), default=None) for k in mine})

    def beyond_sine(self, frequency: float, level_g: float) -> str:
        """The limit that a sine of this peak level exceeds, in words; empty where it exceeds none."""
        w, a = 2.0 * math.pi * frequency, level_g * STANDARD_GRAVITY_M_S2
        return self._beyond(1e3 * a / w**2, a / w, level_g)

    def beyond_random(self, breakpoints: Sequence[tuple[float, float]], level_g: float) -> str:
        """The limit that the three-sigma peaks of a random profile exceed at this overall level in g rms; empty for none."""
        moments = [_moment(breakpoints, power) for power in (-4, -2, 0)]
        if moments[2] <= 0.0:
            return ""
        share = PEAK_FACTOR * level_g / math.sqrt(moments[2])
        mm, m_s = (share * STANDARD_GRAVITY_M_S2 * math.sqrt(moment) for moment in moments[:2])
        return self._beyond(1e3 * mm, m_s, PEAK_FACTOR * level_g)

    def _beyond(self, mm: float, m_s: float, g: float) -> str:
        for peak, most, unit, what in (
            (mm, self.displacement_mm, "mm", "displacement"),
            (m_s, self.velocity_m_s, "m/s", "velocity"),
            (g, self.acceleration_g, "g", "acceleration"),
        ):
            if most is not None and not peak <= 1.001 * most:
                return f"peak {what} {peak:.4g} {unit}, at most {most:g} {unit} is allowed"
        return ""


def _moment(breakpoints: Sequence[tuple[float, float]], power: int) -> float:
    """Integral of density times (2πf)^power, straight segments on log–log paper."""
    total = 0.0
    for (f1, p1), (f2, p2) in pairwise(breakpoints):
        slope = math.log(p2 / p1) / math.log(f2 / f1)
        f = [f1 * (f2 / f1) ** (k / PARTS) for k in range(PARTS + 1)]
        y = [p1 * (x / f1) ** slope * (2.0 * math.pi * x) ** power for x in f]
        total += sum(0.5 * (b - a) * (u + v) for (a, b), (u, v) in zip(pairwise(f), pairwise(y), strict=True))
    return total
