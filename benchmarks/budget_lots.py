"""Lots on a station that draws every stated contribution at random, with the truth of their units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from inertial import poses
from inertial.frames import force_from_angles
from inertial.noise.dwells import DwellNoise, dwell_covariance
from schemas.simulation import ReferenceErrors
from stations.plant.device import Truth, draw_truth, rotation
from stations.plant.hidden.table import StationErrors
from stations.plant.preset import Preset
from stations.plant.table import turn

Array = np.ndarray
VERIFICATION = np.array([[35.0, 15.0], [70.0, 140.0], [105.0, -100.0], [140.0, 60.0], [55.0, -35.0], [125.0, -160.0]])
BASE = ("bias", "scale", "misalignment")
WARM = ("bias_temperature", "bias_temperature_quadratic", "scale_temperature", "scale_temperature_quadratic")
RECIPES = {
    "six faces": ("six", (25.0,)),
    "twelve edges × 3": ("twelve", (0.0, 25.0, 50.0)),
    "24 directions × 3": ("fibonacci24", (-10.0, 25.0, 60.0)),
    "18 × 5": ("eighteen", (-30.0, 0.0, 25.0, 55.0, 85.0)),
}
LOT = 8
DWELL_S, SPACING_S, SOAK_S, RATE_HZ = 10.0, 17.0, 1500.0, 100.0
SEAT, GRADIENT, SOAK_K, GAIN, OFFSET = 500e-6, 0.2, 0.1, 30e-6, 5e-6
DRAWN = ReferenceErrors(
    gravity_ppm=10.0, level_urad=100.0, orthogonality_urad=60.0, outer_offset_urad=60.0, inner_offset_urad=100.0,
    harmonics_urad=40.0, pose_urad=50.0, thermometer_offset_K=0.3, thermometer_slope_percent=0.3,
)  # fmt: skip


@dataclass(frozen=True)
class Plan:
    """Dwells of a recipe: angles in rad, soak, kind, time in s, pose."""

    outer: Array
    inner: Array
    soak: Array
    check: Array
    time: Array
    levels: tuple[float, ...]
    effects: tuple[str, ...]


def plan_of(recipe: str) -> Plan:
    name, levels = RECIPES[recipe]
    own = poses.plan(name)
    block = np.radians(np.concatenate([own, VERIFICATION, VERIFICATION, VERIFICATION]))
    count, soaks = len(block), len(levels)
    check = np.tile(np.arange(count) >= len(own), soaks)
    outer, inner = np.tile(block, (soaks, 1)).T
    soak = np.repeat(np.arange(soaks), count)
    return Plan(
        outer,
        inner,
        soak,
        check,
        SPACING_S * np.arange(outer.size) + SOAK_S * (soak + 1),
        levels,
        BASE + WARM * (soaks > 1),
    )


def measured(
    plan: Plan,
    preset: Preset,
    rng: np.random.Generator,
    drawn_as: ReferenceErrors = DRAWN,
    noise_of: Callable[[], Array] | None = None,
) -> tuple[pd.DataFrame, list[Truth], Array]:
    """Dwells of a lot on a station with errors of its own, the truth of its units, and the noise that they had, g.

    Parameters
    ----------
    noise_of : draws the noise of the dwells of a unit, (n, 3), g; white noise and flicker of the preset where not given
    """
    station = StationErrors(drawn_as, rng)
    scatter = np.radians(station.pose_deg) * rng.standard_normal((2, plan.outer.size))
    outer, inner = station.table(plan.outer, plan.inner)
    up = station.up(np.array([0.0, 0.0, 1.0]))
    force = turn(up, outer + scatter[0], inner + scatter[1], station.orthogonality)
    of_soak = SOAK_K * rng.standard_normal(len(plan.levels))
    noise = DwellNoise(1e-6 * preset.noise_density_ug, 1e-6 * preset.bias_instability_ug, 0.0)
    root = np.linalg.cholesky(dwell_covariance(plan.time, DWELL_S, noise, since=float(plan.time.min()) - 5.0))
    frames, truths, drawn = [], [], []
    for unit in range(LOT):
        serial = f"U{unit}"
        seat = rotation(SEAT * rng.standard_normal(3))
        truth = draw_truth(
            preset, f"{rng.integers(2**31)}", 1, slot_rotation=np.eye(3), supply_ratio=1.0, output_scale=1.0
        )
        element = np.array(plan.levels)[plan.soak] + rng.normal(0.0, 0.3)
        read = station.reading(element - GRADIENT * rng.standard_normal()) + of_soak[plan.soak]
        theta = (element - 25.0)[:, None]
        out = (
            truth.bias_g
            + theta * truth.bias_tempco
            + (1.0 + 1e-6 * truth.scale_ppm)
            * (1.0 + theta * truth.scale_tempco)
            * (force @ seat.T @ truth.misalignment.T)
        )
        own = noise_of() if noise_of else root @ rng.standard_normal((plan.outer.size, 3))
        out = out * (1.0 + GAIN * rng.standard_normal()) + OFFSET * rng.standard_normal(3) + own
        frames.append(_table(plan, serial, unit, read, out, noise.white(DWELL_S)))
        truths.append(truth)
        drawn.append(own)
    return pd.concat(frames, ignore_index=True), truths, np.stack(drawn)


def _table(plan: Plan, serial: str, slot: int, read: Array, out: Array, white: float) -> pd.DataFrame:
    n = int(DWELL_S * RATE_HZ)
    nominal = force_from_angles(plan.outer, plan.inner)
    names = [f"v{k % 6}" if c else f"p{k}" for k, c in enumerate(plan.check)]
    return pd.DataFrame(
        {
            "unit": serial, "slot": slot, "dwell": np.arange(plan.outer.size), "record": np.arange(plan.outer.size),
            "kind": np.where(plan.check, "verification", "dwell"), "pose": names, "soak": plan.soak, "time_s": plan.time,
            "duration_s": DWELL_S, "outer_deg": np.degrees(plan.outer), "inner_deg": np.degrees(plan.inner), "unit_C": read,
            "chamber_C": np.array(plan.levels)[plan.soak], "since_move_s": 7.0, "since_power_s": plan.time, "n": n,
            "out_unit": "g",
            **{f"force_{a}": nominal[:, k] for k, a in enumerate("xyz")}, **{f"out_{a}": out[:, k] for k, a in enumerate("xyz")},
            **{f"sd_{a}": max(white, 1e-9) * np.sqrt(n) for a in "xyz"},
        }
    )  # fmt: skip


def true_coefficients(truth: Truth, effects: tuple[str, ...]) -> Array:
    """(3, p) of a unit in its fixture, in the order of the model's columns."""
    scale = 1.0 + 1e-6 * truth.scale_ppm
    rows = []
    for a in range(3):
        row = [truth.bias_g[a], scale[a], *(scale[a] * truth.misalignment[a, (a + k) % 3] for k in (1, 2))]
        if len(effects) > len(BASE):
            row += [truth.bias_tempco[a], 0.0, scale[a] * truth.scale_tempco[a], 0.0]
        rows.append(row)
    return np.array(rows)
