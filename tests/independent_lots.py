"""Lots and static records for judging what is stated of noise: plain physics with the noise of `independent_noise`."""

from dataclasses import dataclass

import independent_noise as made
import numpy as np
import pandas as pd
from lots import directions, force

Array = np.ndarray
NO_HISTORY = pd.DataFrame({name: pd.Series(dtype=float) for name in ("time_s", "chamber_C", "slot", "unit", "unit_C")})
UG = 1e-6


@dataclass(frozen=True)
class World:
    """A lot's dwells, and the truth: bias (units, 3), µg, over the record and the day after it; response (units, 3, 3)."""

    dwells: pd.DataFrame
    record: Array
    day: Array
    gain: Array


def world(
    rng: np.random.Generator,
    *,
    units: int = 4,
    plan: str = "six",
    temperatures: tuple[float, ...] = (25.0,),
    checks: tuple[tuple[float, float], ...] = ((35.0, 15.0), (125.0, -160.0)),
    density: float = 25.0,
    flicker: float = 300.0,
    walk: float = 0.0,
    dwell_s: int = 10,
    move_s: int = 10,
    soak_s: int = 1800,
    day_s: int = 86_400,
    step: int = 10,
) -> World:
    """Dwells of units whose noise is made on a grid of ``step`` s over the record and ``day_s`` s after it.

    The flicker reaches down to an eighth of the inverse of that whole time. Poses for verification stand between those of
    the fit.
    """
    fit = directions(plan)
    every = max(len(fit) // max(len(checks), 1), 1)
    angles, kinds, poses = [], [], []
    for k, pair in enumerate(fit):
        angles.append(pair)
        kinds.append("dwell")
        poses.append(f"p{k}")
        if k % every == every - 1 and k // every < len(checks):
            angles.append(np.radians(checks[k // every]))
            kinds.append("verification")
            poses.append(f"v{k // every}")
    soaks = len(temperatures)
    angles, per = np.tile(np.array(angles), (soaks, 1)), len(angles)
    start = (dwell_s + move_s) * np.arange(per * soaks) + soak_s * (np.arange(per * soaks) // per)
    warm = np.repeat(temperatures, per)
    length = int(start[-1]) + dwell_s
    grid = -(-(length + day_s) // step)
    slow = made.flicker(rng, 3 * units, grid, flicker, longer=8) if flicker else np.zeros((3 * units, grid))
    slow = slow + made.walk(rng, 3 * units, grid, walk, 1.0 / step)
    noise = made.dwell_means(slow, start // step, max(dwell_s // step, 1))
    noise = noise + density / np.sqrt(2.0 * dwell_s) * rng.standard_normal(noise.shape)
    noise = UG * noise.reshape(units, 3, -1)
    sd = UG * density * np.sqrt(100.0 / 2.0)
    f = force(angles)
    frames, gains = [], np.eye(3) + rng.normal(0.0, 0.003, (units, 3, 3))
    for u in range(units):
        out = f @ gains[u].T + noise[u].T
        frames.append(
            pd.DataFrame(
                {
                    "unit": f"U{u:03d}", "dwell": np.arange(len(f)), "time_s": start + dwell_s / 2.0,
                    "kind": np.tile(kinds, soaks),
                    "pose": np.tile(poses, soaks), "out_unit": "g", "unit_C": warm, "n": 100 * dwell_s,
                    **{f"force_{a}": f[:, i] for i, a in enumerate("xyz")},
                    **{f"out_{a}": out[:, i] for i, a in enumerate("xyz")},
                    **{f"sd_{a}": sd * rng.uniform(0.97, 1.03, len(f)) for a in "xyz"},
                }
            )
        )  # fmt: skip
    cut = length // step
    first, rest = slow[:, : max(cut, 1)].mean(axis=1), slow[:, cut:]
    day = rest.mean(axis=1) if rest.shape[1] else first
    return World(pd.concat(frames, ignore_index=True), first.reshape(units, 3), day.reshape(units, 3), gains)


def static_record(
    values: Array, rate: float, *, pose: tuple[float, float] = (0.0, 0.0)
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Samples and readings of a static record of outputs (units, n, 3) in g."""
    units, n, _ = values.shape
    samples = pd.concat(
        [
            pd.DataFrame(
                {"unit": f"U{u:03d}", "slot": u, "record": 99, "kind": "allan", "time_s": np.arange(n) / rate,
                 "x": v[:, 0], "y": v[:, 1], "z": v[:, 2]}
            )
            for u, v in enumerate(values)
        ],
        ignore_index=True,
    )  # fmt: skip
    readings = pd.DataFrame(
        {
            "unit": [f"U{u:03d}" for u in range(units)], "record": 99, "kind": "allan", "status": "ok", "n": n, "rate_hz": rate,
            "start_s": 0.0, "outer_deg": pose[0], "inner_deg": pose[1],
        }
    )  # fmt: skip
    return samples, readings


def room(rng: np.random.Generator, units: int, seconds: float, size_K: float) -> tuple[pd.DataFrame, Array]:
    """Readings of the units' thermometers every 10 s in a room that drifts smoothly by about ``size_K``, and the true course.

    The thermometers read with 5 mK of noise and a digit of 10 mK. The course, a function of time, comes back on the same times.
    """
    time = np.arange(0.0, seconds + 1.0, 10.0)
    phase = rng.uniform(0.0, 2.0 * np.pi, 3)
    course = sum(
        np.sin(2.0 * np.pi * time / (seconds * part) + one) for part, one in zip((1.7, 0.9, 0.5), phase, strict=True)
    )
    course = 25.0 + size_K * course / np.ptp(course)
    rows = [
        pd.DataFrame(
            {"time_s": time, "chamber_C": 25.0, "slot": u, "unit": f"U{u:03d}",
             "unit_C": np.round((course + 0.005 * rng.standard_normal(time.size)) / 0.01) * 0.01}
        )
        for u in range(units)
    ]  # fmt: skip
    return pd.concat(rows, ignore_index=True), course
