"""Small lots of dwells for tests: a table in the exchange format from plain physics."""

from collections.abc import Callable

import numpy as np
import pandas as pd

Array = np.ndarray
Physics = Callable[[Array, Array, Array, np.random.Generator], Array]

FIBONACCI = 24


def directions(plan: str) -> Array:
    """Angles (n, 2) in rad, outer and inner, written out here and not taken from the code under test."""
    if plan == "six":
        faces = [(0, 0), (180, 0), (90, 90), (90, -90), (90, 0), (90, 180)]
        return np.radians(np.array(faces, dtype=float))
    k = np.arange(FIBONACCI) + 0.5
    z = 1.0 - 2.0 * k / FIBONACCI
    turn = np.pi * (1.0 + 5.0**0.5) * k
    return np.stack([np.arccos(z), np.pi / 2.0 - turn], axis=1)


def force(angles: Array, up: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Array:
    """(Rx(outer)·Rz(inner))ᵀ·up by matrices, (n, 3)."""
    out = []
    for a, b in angles:
        rx = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        rz = np.array([[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]])
        out.append((rx @ rz).T @ np.array(up))
    return np.array(out)


def dwell_rows(unit: str, time: Array, force_g: Array, output: Array, sd: float, **more: object) -> pd.DataFrame:
    """Dwells of one unit in the exchange format, from forces and outputs (n, 3)."""
    known = {
        "unit": unit,
        "dwell": np.arange(len(time)),
        "time_s": time,
        "kind": "dwell",
        "pose": "p",
        "out_unit": "g",
        "n": 100,
    }
    axes = {f"{name}_{a}": v[:, i] for name, v in (("force", force_g), ("out", output)) for i, a in enumerate("xyz")}
    return pd.DataFrame({**known, **axes, **{f"sd_{a}": sd for a in "xyz"}, **more})


def lot(
    rng: np.random.Generator,
    *,
    units: int = 4,
    plan: str = "fibonacci",
    temperatures: tuple[float, ...] = (0.0, 25.0, 50.0),
    noise_ug: float = 10.0,
    hidden: Physics | None = None,
    up: tuple[float, float, float] = (0.0, 0.0, 1.0),
) -> pd.DataFrame:
    """Dwells of a lot whose units differ in bias, scale, misalignment and temperature coefficients.

    hidden : (force (n, 3), temperature (n,), time (n,), generator) → what it adds to the output, (n, 3), g
    """
    angles = np.tile(directions(plan), (len(temperatures), 1))
    per_soak = len(angles) // len(temperatures)
    time = 30.0 * np.arange(len(angles)) + 3600.0 * np.repeat(np.arange(len(temperatures)), per_soak)
    frames = []
    for unit in range(units):
        f = force(angles, up)
        warm = np.repeat(temperatures, per_soak) + rng.normal(0.0, 0.3) + rng.normal(0.0, 0.005, len(angles))
        theta = (warm - 25.0)[:, None]
        seen = f @ (np.eye(3) + rng.normal(0.0, 0.004, (3, 3))).T
        out = (
            seen + rng.normal(0.0, 0.03, 3) + theta * rng.normal(0.0, 5e-5, 3) + theta * rng.normal(0.0, 1e-4, 3) * seen
        )
        if hidden is not None:
            out = out + hidden(f, warm, time, rng)
        out = out + rng.normal(0.0, noise_ug * 1e-6, out.shape)
        frames.append(
            pd.DataFrame(
                {
                    "unit": f"U{unit:03d}",
                    "dwell": np.arange(len(angles)),
                    "time_s": time,
                    "outer_deg": np.degrees(angles[:, 0]),
                    "inner_deg": np.degrees(angles[:, 1]),
                    "unit_C": warm,
                    "since_move_s": 12.0,
                    "n": 1000,
                    **{f"out_{a}": out[:, i] for i, a in enumerate("xyz")},
                    **{
                        f"sd_{a}": noise_ug * 1e-6 * np.sqrt(1000.0) * rng.uniform(0.97, 1.03, len(angles))
                        for a in "xyz"
                    },
                }
            )
        )
    return pd.concat(frames, ignore_index=True)
