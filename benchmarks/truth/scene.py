"""What surrounds the sensors during one run: temperatures, supply, vibration, covariates, table read-back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .memory import lag
from .spec import Spec
from .timeline import GRID_S, Timeline

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Places:
    """What stays with the station and the lot from run to run."""

    slot_lag: Floats  # (U,) s
    die_lag: float  # s
    self_heating: Floats  # (U,) K
    reading_noise: float  # °C in a dwell mean
    reading_offset: Floats  # (U,) °C
    chamber_ripple: float  # °C
    ripple_period: float  # s

    @staticmethod
    def draw(rng: np.random.Generator, units: int) -> Places:
        """Places of a fixture with `units` slots."""
        return Places(
            rng.uniform(240.0, 480.0) * (1.0 + 0.15 * rng.standard_normal(units)).clip(0.6, 1.4),
            float(rng.uniform(20.0, 60.0)),
            rng.uniform(0.3, 1.5) * (1.0 + 0.1 * rng.standard_normal(units)),
            float(10.0 ** rng.uniform(-3.0, -1.8)),
            0.2 * rng.standard_normal(units),
            float(rng.uniform(0.02, 0.2)),
            float(rng.uniform(240.0, 900.0)),
        )


@dataclass(frozen=True)
class Scene:
    """One run as the physics sees it. Grid series are (G,) or (U, G); dwell series (n,) or (U, n); angles in radians."""

    timeline: Timeline
    grid: Floats
    chamber: Floats  # (G,) °C
    die: Floats  # (U, G) °C
    outer: Floats  # (n,) read-back
    inner: Floats  # (n,) read-back
    supply: Floats  # (n,) V
    vibration: Floats  # (n,) g rms
    covariates: dict[str, Floats]  # (n,) each
    reading_error: Floats  # (U, n) °C
    first: NDArray[np.int64]
    last: NDArray[np.int64]

    @property
    def units(self) -> int:
        """How many units are on the fixture."""
        return self.die.shape[0]

    @property
    def middle(self) -> Floats:
        """Middle of each dwell, (n,), s since the run began."""
        return self.timeline.start + self.timeline.dwell / 2.0

    def over_dwell(self, series: Floats) -> Floats:
        """Mean of a grid series, (..., G), over each dwell, (..., n)."""
        total = np.concatenate([np.zeros((*series.shape[:-1], 1)), np.cumsum(series, axis=-1)], axis=-1)
        return (total[..., self.last] - total[..., self.first]) / (self.last - self.first)

    @property
    def temperature(self) -> Floats:
        """True temperature of each die over each dwell, (U, n), °C."""
        return self.over_dwell(self.die)

    def since_power(self, at: Floats) -> Floats:
        """Seconds since the last switching on at the instants `at`."""
        return at - self.timeline.power_on[np.searchsorted(self.timeline.power_on, at, side="right") - 1]


def powered_on(timeline: Timeline, grid: Floats) -> Floats:
    """1 where the devices have power, 0 where it is off, (G,)."""
    last = np.searchsorted(timeline.power_on, grid, side="right")
    following = np.append(timeline.power_on - timeline.power_gap, np.inf)[last]
    return (grid < following).astype(float)


def _chamber(timeline: Timeline, grid: Floats, places: Places, rng: np.random.Generator) -> Floats:
    target = np.interp(grid, timeline.profile[:, 0], timeline.profile[:, 1])
    air = lag(target, 90.0, GRID_S)
    phase = rng.uniform(0.0, 2.0 * np.pi)
    ripple = places.chamber_ripple * np.sin(2.0 * np.pi * grid / places.ripple_period + phase)
    wander = lag(rng.standard_normal(grid.size), 600.0, GRID_S)
    return air + ripple + 0.05 * wander / max(float(wander.std()), 1e-12)


def _wander(rng: np.random.Generator, grid: Floats, tau: float) -> Floats:
    """Smooth random wander of about unit size, correlated over `tau` s."""
    lead = int(5.0 * tau / GRID_S)
    noise = rng.standard_normal(grid.size + lead)
    smooth = lag(lag(noise, tau / 2.0, GRID_S), tau / 2.0, GRID_S)
    return (smooth / smooth.std())[lead:]


def _covariates(rng: np.random.Generator, grid: Floats, chamber: Floats) -> dict[str, Floats]:
    span = float(grid[-1])
    warm = (chamber - chamber.mean()) / max(float(chamber.std()), 5.0)
    steps = np.repeat(rng.standard_normal(grid.size // 120 + 1), 120)[: grid.size]
    return {
        "humidity_pct": 45.0 + 8.0 * _wander(rng, grid, min(5400.0, span / 4.0)) - 3.0 * warm,
        "pressure_hPa": 1008.0 + 4.0 * _wander(rng, grid, min(14400.0, span / 3.0)),
        "heater_mA": 180.0 + 40.0 * steps + 15.0 * warm + 3.0 * rng.standard_normal(grid.size),
        "fan_rpm": 1500.0 + 200.0 * _wander(rng, grid, 900.0),
        "rf_dBm": -60.0 + 6.0 * rng.standard_normal(grid.size),
    }


COVARIATES = ("humidity_pct", "pressure_hPa", "heater_mA", "fan_rpm", "rf_dBm")


def build(spec: Spec, timeline: Timeline, places: Places, rng: np.random.Generator) -> Scene:
    """Conditions of one run; another `rng` gives the same plan on another day."""
    grid = np.arange(0.0, timeline.end + 2.0 * GRID_S, GRID_S)
    chamber = _chamber(timeline, grid, places, rng)
    fixture = np.stack([lag(chamber, float(tau), GRID_S) for tau in places.slot_lag])
    powered = powered_on(timeline, grid)
    powered[0] = 0.0
    heat = places.self_heating[:, None] * lag(powered, 180.0, GRID_S)
    die = lag(fixture, places.die_lag, GRID_S) + heat
    first = np.round(timeline.start / GRID_S).astype(np.int64)
    last = first + max(1, round(timeline.dwell / GRID_S))
    count = len(timeline.start)
    read = timeline.commanded + 0.0004 * rng.standard_normal((count, 2))
    cooling = (np.gradient(chamber, GRID_S) < -0.005) | (_wander(rng, grid, 700.0) > 0.3)
    compressor = (0.01 + 0.09 * cooling) * np.exp(0.25 * _wander(rng, grid, 600.0))
    supply = (
        3.3
        + 0.004 * _wander(rng, grid, 3600.0)
        + 0.003 * np.sign(np.sin(2.0 * np.pi * grid / rng.uniform(1500.0, 4000.0)))
    )
    scene = Scene(
        timeline, grid, chamber, die, np.radians(read[:, 0]), np.radians(read[:, 1]), np.zeros(count), np.zeros(count), {},
        places.reading_noise * rng.standard_normal((spec.units, count)), first, last,
    )  # fmt: skip
    columns = {name: scene.over_dwell(series) for name, series in _covariates(rng, grid, chamber).items()}
    return Scene(
        timeline, grid, chamber, die, scene.outer, scene.inner, scene.over_dwell(supply), scene.over_dwell(compressor), columns,
        scene.reading_error, first, last,
    )  # fmt: skip
