"""Measure a lot twice on a simulated station with a hidden effect.

Drivers and registers are those of a production station; only the physics is simulated. The diagnosis gets only the dwells.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from inertial import poses
from pipelines.archive import files
from pipelines.capture.capture import capture
from pipelines.demo.scenes import Scene
from pipelines.jobs.recipes import load_recipe
from pipelines.stages.reduce import reduce
from pipelines.tables.summaries import summarised
from schemas.errors import WrongUse
from schemas.lot import Lot, Unit
from schemas.poses import Pose
from schemas.progress import Progress, silent
from schemas.recipe import Recipe
from schemas.simulation import Hidden
from schemas.station import Soak, StationConfig, load_station
from stations import open_station

UNITS = 4
QUIET = {"noise_density_ug": 8.0, "bias_instability_ug": 1.5, "rate_random_walk_ug": 0.003, "linearity_pct_fs": 0.0}
"""A unit with low noise: with the noise of the data sheet most effects would need days of measurement."""


@dataclass(frozen=True)
class DemoLot:
    """A lot measured twice: dwells and temperatures of the first and of the second run."""

    dwells: pd.DataFrame
    history: pd.DataFrame
    fresh: pd.DataFrame
    fresh_history: pd.DataFrame

    def write(self, folder: Path) -> None:
        """The four tables as Parquet files."""
        for name in ("dwells", "history", "fresh", "fresh_history"):
            content = getattr(self, name).to_parquet(index=False)
            files.publish(folder / f"{name.replace('_', '-')}.parquet", content, "demo", files.ELSEWHERE)


def measure(chosen: Scene, seed: int, progress: Progress = silent) -> DemoLot:
    """Measure the lot on the simulated station with the hidden effect, twice with independent noise."""
    recipe = _recipe(chosen)
    tables = [*_once(recipe, chosen, seed, 0, progress), *_once(recipe, chosen, seed, 1, progress)]
    return DemoLot(*tables)


@dataclass
class _InMemory:
    """The results of a capture in memory, because a demonstration is never resumed."""

    samples: list[pd.DataFrame] = field(default_factory=list)
    readings: list[pd.DataFrame] = field(default_factory=list)
    history: list[pd.DataFrame] = field(default_factory=list)

    def finished(self) -> set[int]:
        """No records exist before the start."""
        return set()

    def part(self, record: int, number: int, samples: pd.DataFrame) -> None:
        """Store a part of a record."""
        self.samples.append(samples)

    def put(
        self,
        record: int,
        samples: pd.DataFrame,
        readings: pd.DataFrame,
        history: pd.DataFrame,
        station_state: bytes,
        parts: int = 0,
    ) -> None:
        """Store one record."""
        self.samples.append(samples)
        self.readings.append(readings)
        self.history.append(history)

    def last_state(self) -> bytes | None:
        """No state of an earlier capture exists."""
        return None


def _once(recipe: Recipe, chosen: Scene, seed: int, repeat: int, progress: Progress) -> list[pd.DataFrame]:
    units = [Unit(serial=f"DEMO-{k + 1}", slot=k) for k in range(UNITS)]
    lot = Lot(units=units, device=recipe.device, sensor_axes=recipe.sensor_axes, seed=seed, repeat=repeat)
    records = _InMemory()
    with open_station(_station(chosen, seed), lot) as station:
        capture(station, recipe, lot, records, progress=progress)
    accepted = pd.DataFrame({"unit": [u.serial for u in units], "refused": False})
    readings = pd.concat(records.readings, ignore_index=True)
    dwells = reduce(summarised(records.samples, readings), readings, accepted, recipe.local_gravity_m_s2)
    return [dwells, pd.concat([h for h in records.history if len(h)], ignore_index=True)]


def _recipe(chosen: Scene) -> Recipe:
    rng = np.random.default_rng(20)
    angles = np.concatenate([rng.permutation(poses.plan(chosen.plan)) for _ in range(chosen.repeats)])
    changes: dict[str, Any] = {
        "name": f"demo-{chosen.kind.replace('_', '-')}",
        "description": "a small plan of the demonstration",
        "poses": [Pose(name=f"p{k + 1:03d}", outer_deg=o, inner_deg=i) for k, (o, i) in enumerate(angles.tolist())],
        "verification": [],
        "temperatures_C": list(chosen.temperatures),
        "soak_min_s": 900.0 if chosen.soak == Soak() else 1.0,
        "allow_short_soak": True,
        "settle_s": chosen.settle_s,
        "dwell_s": 4.0,
        "rate_hz": 25.0,
        "static_record_s": 0.0,
        "effects": list(chosen.model),
    }
    return load_recipe().model_copy(update=changes)


def _station(chosen: Scene, seed: int) -> StationConfig:
    plain = load_station()
    simulation = plain.simulation
    steady = {} if len(chosen.temperatures) > 1 else {"bias_tempco_ug_per_K": 2.0, "scale_tempco_ppm_per_K": 4.0}
    if simulation is None:
        raise WrongUse(
            "demo: the built-in station is not simulated, a simulated one is needed; restore stations/simulated.toml"
        )
    hidden = [Hidden(kind=chosen.kind, figures=chosen.figures)]
    changed = simulation.model_copy(update={"seed": seed, "hidden": hidden, "preset_overrides": QUIET | steady})
    return plain.model_copy(update={"simulation": changed, "soak": chosen.soak})
