"""Lots of a production line: what all of many units have in common, though each of them hardly shows it.

``python -m benchmarks.large_lots`` judges lots of 12 poses in three soaks with a hidden effect, drawn without the product's
columns, and lots in which only the poses or the noise of all units differ alike.
"""

import argparse
from itertools import product

import numpy as np
import pandas as pd

from inertial.criticism.diagnosis import diagnose
from inertial.estimation.problem import Lot
from inertial.frames import force_from_angles
from pipelines.tables.dwells import lot_of, measured

NOISE = 2e-5
"""White noise of a dwell, g."""

MODEL = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
"""What the units have, and a linear bias over the temperature."""

EFFECTS = {
    "cubic": "third_order",
    "quadratic": "bias_temperature_quadratic",
    "warm-up": "warm_up",
    "play": "pose_hysteresis",
}


def many_units(count: int, seed: int, common: str = "", size: float = 0.0) -> Lot:
    """A lot, with an effect that all units have with a spread of 5 %, or with poses that differ alike for all units.

    Parameters
    ----------
    common : "cubic" of the force, "quadratic" of the temperature in the bias, "warm-up" over a quarter of an hour, "play" of
        0.3 g about the force, or "poses"
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
        "play": _play(force, 0.3),
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


def _play(force: np.ndarray, half_width: float) -> np.ndarray:
    """The part (n, 3) of a force (n, 3) that a part with play does not follow, dwell after dwell, from rest."""
    left, position = np.zeros(force.shape), np.zeros(3)
    for dwell, value in enumerate(force):
        position = np.clip(position, value - half_width, value + half_width)
        left[dwell] = value - position
    return left


def main() -> None:
    """Print a row for each effect and size, and for lots without one."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.large_lots", description=__doc__)
    parser.add_argument("--units", type=int, default=100)
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--sizes", type=float, nargs="+", default=[0.5, 1.0])
    given = parser.parse_args()
    rows = [(common, size) for common in EFFECTS for size in given.sizes] + [("", 0.0), ("poses", 0.5), ("poses", 1.5)]
    print(f"{given.units} units, {given.runs} lots each: in its class, another named, told as unexplained, adequate")
    for common, size in rows:
        counts = np.zeros(4, dtype=int)
        for seed in range(given.first, given.first + given.runs):
            found = diagnose(many_units(given.units, seed, common, size), MODEL, np.random.default_rng(seed))
            held = [EFFECTS.get(common) in named.effects.ids for named in found.named]
            counts += any(held), not all(held), found.unexplained is not None, found.adequate is True
        print(f"{common or 'noise alone':12s} {size:3g} of the noise: " + " · ".join(map(str, counts)), flush=True)


if __name__ == "__main__":
    main()
