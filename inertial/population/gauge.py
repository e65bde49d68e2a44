"""Gauge repeatability and reproducibility from repeated mounts, by analysis of variance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import f as f_distribution

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

POOL_ABOVE = 0.25  # p-value above which the interaction is pooled with repeatability (AIAG MSA, 4th ed., appendix A)


@dataclass(frozen=True)
class Gauge:
    """Standard deviations of the parts of a measurement system, the values' unit.

    repeatability : of one unit mounted again on one station; reproducibility : between stations, interaction included
    percent : of the total variation that the gauge takes; categories : that it can tell apart (ndc)
    """

    parts: int
    stations: int
    mounts: int
    repeatability: float
    reproducibility: float
    interaction: float
    part: float
    interaction_p: float
    pooled: bool

    @property
    def gauge(self) -> float:
        """Standard deviation of the whole measurement system."""
        return float(np.hypot(self.repeatability, self.reproducibility))

    @property
    def total(self) -> float:
        """Standard deviation of all that was seen."""
        return float(np.hypot(self.gauge, self.part))

    @property
    def percent(self) -> float:
        """Share of the gauge in the total standard deviation, %."""
        return 100.0 * self.gauge / self.total if self.total > 0.0 else 0.0

    @property
    def categories(self) -> int:
        """Number of distinct categories, ndc = 1.41·part/gauge, never below one."""
        return max(1, int(np.sqrt(2.0) * self.part / self.gauge)) if self.gauge > 0.0 else 1


def gauge_study(values: Array) -> Gauge:
    """Gauge R&R of a crossed study by ANOVA (AIAG MSA, 4th ed., chapter III-B and appendix A).

    Parameters
    ----------
    values : (parts, stations, mounts); one station leaves reproducibility zero.
    """
    p, o, r = values.shape
    grand, by_part, by_station = values.mean(), values.mean(axis=(1, 2)), values.mean(axis=(0, 2))
    cell = values.mean(axis=2)
    ss_part = o * r * np.sum((by_part - grand) ** 2)
    ss_station = p * r * np.sum((by_station - grand) ** 2)
    ss_cross = r * np.sum((cell - by_part[:, None] - by_station + grand) ** 2)
    ss_error = np.sum((values - cell[..., None]) ** 2)
    df_cross, df_error = (p - 1) * (o - 1), p * o * (r - 1)
    ms_error = ss_error / df_error
    p_value = _p_value(ss_cross, df_cross, ms_error, df_error)
    pooled = p_value > POOL_ABOVE
    if pooled:
        ms_error = (ss_error + ss_cross) / (df_error + df_cross)
    ms_cross = ms_error if pooled else ss_cross / df_cross
    interaction = max(0.0, (ms_cross - ms_error) / r)
    station = max(0.0, (ss_station / (o - 1) - ms_cross) / (p * r)) if o > 1 else 0.0
    part = max(0.0, (ss_part / (p - 1) - ms_cross) / (o * r))
    return Gauge(
        parts=p,
        stations=o,
        mounts=r,
        repeatability=float(np.sqrt(ms_error)),
        reproducibility=float(np.sqrt(station + interaction)),
        interaction=float(np.sqrt(interaction)),
        part=float(np.sqrt(part)),
        interaction_p=p_value,
        pooled=pooled,
    )


def _p_value(ss_cross: float, df_cross: int, ms_error: float, df_error: int) -> float:
    if df_cross == 0 or ms_error == 0.0:
        return 1.0
    return float(f_distribution.sf(ss_cross / df_cross / ms_error, df_cross, df_error))
