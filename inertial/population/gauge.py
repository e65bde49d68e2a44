"""Gauge repeatability and reproducibility from repeated mounts, by analysis of variance."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from inertial.arrays import Array

POOL_ABOVE = 0.25  # p-value above which the interaction is pooled with repeatability (AIAG MSA, 4th ed., appendix A)

DRAWS, DRAW_SEED = 4000, 1


@dataclass(frozen=True)
class Gauge:
    """Standard deviations of the parts of a measurement system, the values' unit.

    repeatability : of one unit mounted again on one station; reproducibility : between stations, interaction included
    gauge_interval, percent_interval : ends of 95 % intervals of ``gauge`` and ``percent``; two stations tell next to nothing of
        what lies between stations
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
    gauge_interval: tuple[float, float]
    percent_interval: tuple[float, float]

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
    # of the interaction; there is none on one station
    p_value = 1.0
    if df_cross > 0 and ms_error > 0.0:
        p_value = float(f_distribution.sf(ss_cross / df_cross / ms_error, df_cross, df_error))
    pooled = p_value > POOL_ABOVE
    if pooled:
        ms_error = (ss_error + ss_cross) / (df_error + df_cross)
    ms_cross = ms_error if pooled else ss_cross / df_cross
    squares = np.array([ss_part / (p - 1), ss_station / (o - 1) if o > 1 else 0.0, ms_cross, ms_error])
    dof = (p - 1, o - 1, df_cross, df_error + df_cross if pooled else df_error)
    part, station, interaction = (float(component) for component in _components(squares, values.shape))
    gauge_interval, percent_interval = _intervals(squares, dof, values.shape, pooled=pooled)
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
        gauge_interval=gauge_interval,
        percent_interval=percent_interval,
    )


def _components(squares: Array, shape: tuple[int, ...]) -> Array:
    """Variances (3, ...) of parts, stations and their interaction, none negative, from mean squares (4, ...).

    squares : of parts, stations, interaction and error
    """
    p, o, r = shape
    parts, stations, cross, error = squares
    station = (stations - cross) / (p * r) if o > 1 else np.zeros_like(cross)
    return np.maximum(np.stack([(parts - cross) / (o * r), station, (cross - error) / r]), 0.0)


def _intervals(
    squares: Array, dof: tuple[int, ...], shape: tuple[int, ...], *, pooled: bool
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Generalised 95 % intervals of gauge and of its share in %: each mean square S²·ν/χ² (Burdick et al., 2005, 3.4).

    The draws of χ² are the same for every study, so that a study has one result.
    """
    draws = np.random.default_rng(DRAW_SEED).chisquare(np.maximum(dof, 1)[:, None], size=(4, DRAWS))
    drawn = (squares * np.array(dof))[:, None] / draws
    if pooled:
        drawn[2] = drawn[3]
    part, station, interaction = _components(drawn, shape)
    gauge = station + interaction + drawn[3]
    total = gauge + part
    percent = 100.0 * np.sqrt(np.divide(gauge, total, out=np.zeros_like(total), where=total > 0.0))
    (low, high), (least, most) = (np.quantile(sample, [0.025, 0.975]).tolist() for sample in (np.sqrt(gauge), percent))
    return (low, high), (least, most)
