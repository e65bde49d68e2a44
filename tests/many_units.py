"""Lots of a production line: many units in 12 poses and three soaks, with what all have in common, drawn without the product."""

from itertools import product

import numpy as np
import pandas as pd

from inertial.estimation.problem import Lot
from inertial.frames import force_from_angles
from pipelines.tables.dwells import lot_of, measured

NOISE = 2e-5
"""White noise of a dwell, g."""


def many_units(count: int, seed: int, common: str = "", size: float = 0.0) -> Lot:
    """A lot, with an effect that all units have with a spread of 5 %, or with poses that differ alike for all units.

    Parameters
    ----------
    common : "cubic" of the force, "quadratic" of the temperature in the bias, "warm-up" over a quarter of an hour, or "poses"
    size : RMS of the effect, or of the angle in rad, over the noise of a dwell in g
    """
    rng = np.random.default_rng(seed)
    turns = np.radians([*product((0, 180), (0,)), *product((90,), (0, 90, 180, 270)), (45, 0), (135, 90), (45, 180)])
    turns = np.concatenate([turns, np.radians([(135, 270), (60, 45), (120, 225)])])
    force = np.tile(force_from_angles(*turns.T), (3, 1))
    celsius = np.repeat([10.0, 25.0, 40.0], 12)
    time = 20.0 * np.arange(36) + 100.0 * (celsius - 10.0)
    rows = pd.DataFrame(force, columns=["force_x", "force_y", "force_z"])
    rows = rows.assign(dwell=range(36), time_s=time, unit_C=celsius, chamber_C=celsius, n=400, duration_s=8.0)
    shapes = {
        "": np.zeros(1),
        "cubic": force**3,
        "quadratic": (celsius[:, None] - 25.0) ** 2,
        "warm-up": np.exp(-time / 900.0)[:, None],
    }
    turned = force
    if common == "poses":
        turned, common = force + np.cross(force, NOISE * size * rng.standard_normal((36, 3))), ""
    shape = shapes[common] * np.ones((36, 3))
    shape = NOISE * size * shape / max(float(np.sqrt(np.mean(shape**2))), 1e-300)
    units: list[pd.DataFrame] = []
    for unit in range(count):
        gain = 1.0 + 5e-3 * rng.standard_normal(3) + 1e-5 * (celsius[:, None] - 25.0)
        out = gain * (turned @ (np.eye(3) + 2e-3 * rng.standard_normal((3, 3)))) + NOISE * rng.standard_normal((36, 3))
        out += shape * (1.0 + 0.05 * rng.standard_normal())
        values = {f"out_{a}": out[:, k] for k, a in enumerate("xyz")} | dict.fromkeys(("sd_x", "sd_y", "sd_z"), 4e-4)
        units.append(rows.assign(unit=f"U{unit}", out_unit="g", **values))
    return lot_of(measured(pd.concat(units, ignore_index=True)))
