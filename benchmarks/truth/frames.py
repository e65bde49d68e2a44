"""The measurements as tables: dwells in the exchange format, and the history of temperature."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .chain import nominal_force
from .device import Lot
from .scene import Places, Scene, powered_on
from .sizing import reading
from .spec import Spec
from .timeline import GRID_S

Floats = NDArray[np.float64]
AXES = ("x", "y", "z")
HISTORY_STEP = 2  # every second point of the grid: 10 s


def dwells(
    spec: Spec, lot: Lot, places: Places, scene: Scene, output: Floats, rng: np.random.Generator
) -> pd.DataFrame:
    """One row per unit and dwell; `output` is (U, n, 3) in g of nominal sensitivity, noise included."""
    units, count = output.shape[:2]
    samples = round(scene.timeline.dwell * lot.kind.rate)
    scatter = lot.sample_noise[:, None] * np.sqrt(rng.chisquare(samples - 1, (units, count, 3)) / (samples - 1))
    rows: dict[str, object] = {
        "unit": np.repeat(np.array(lot.names, dtype=object), count),
        "dwell": np.tile(np.arange(count), units),
        "slot": np.repeat(np.arange(units), count),
        "time_s": np.tile(scene.middle, units),
    }
    for axis, name in enumerate(AXES):
        rows[f"out_{name}"] = (lot.kind.zero + lot.kind.per_g * output[..., axis]).ravel()
    for axis, name in enumerate(AXES):
        rows[f"sd_{name}"] = (lot.kind.per_g * scatter[..., axis]).ravel()
    if spec.reference == "force":
        for axis, name in enumerate(AXES):
            rows[f"force_{name}"] = np.tile(nominal_force(scene)[:, axis], units)
    else:
        rows["outer_deg"] = np.tile(np.degrees(scene.outer), units)
        rows["inner_deg"] = np.tile(np.degrees(scene.inner), units)
    line = scene.timeline
    rows |= {
        "n": np.full(units * count, samples),
        "duration_s": np.full(units * count, line.dwell),
        "unit_C": (reading(scene) + places.reading_offset[:, None]).ravel(),
        "chamber_C": np.tile(scene.over_dwell(scene.chamber) + 0.01 * rng.standard_normal(count), units),
        "since_move_s": np.tile(line.wait + line.dwell / 2.0, units),
        "since_power_s": np.tile(scene.since_power(scene.middle), units),
        "supply_V": np.tile(scene.supply, units),
        "vibration_g": np.tile(scene.vibration, units),
        "out_unit": lot.kind.out_unit,
    }
    shown = list(
        dict.fromkeys(
            [*spec.decoys, *(name.partition(":")[2] for name in spec.effects if name.startswith("covariate:"))]
        )
    )
    rows |= {name: np.tile(scene.covariates[name], units) for name in sorted(shown)}
    return pd.DataFrame(rows)


def history(lot: Lot, places: Places, scene: Scene, rng: np.random.Generator) -> pd.DataFrame:
    """Temperatures between the dwells, every 10 s: `time_s, chamber_C, slot, unit, unit_C`."""
    grid = scene.grid[::HISTORY_STEP] + GRID_S / 2.0
    units, count = scene.units, len(grid)
    noise = 2.0 * places.reading_noise * rng.standard_normal((units, count))
    table = pd.DataFrame(
        {
            "time_s": np.tile(grid, units),
            "chamber_C": np.tile(scene.chamber[::HISTORY_STEP], units),
            "slot": np.repeat(np.arange(units), count),
            "unit": np.repeat(np.array(lot.names, dtype=object), count),
            "unit_C": (scene.die[:, ::HISTORY_STEP] + places.reading_offset[:, None] + noise).ravel(),
        }
    )
    on = np.tile(powered_on(scene.timeline, grid) > 0.0, units)  # a device without power tells no temperature
    return table[on].reset_index(drop=True)
