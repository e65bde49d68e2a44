"""``python -m benchmarks.procedure_arrays [units] [seed]``: pulls of four procedures, the plant's noise alone.

Stability, warm-up, bias shift by shock, and supply voltage.

The noise of the simulated devices is drawn without a station, three axes a unit, and goes through the science of the procedures:
many more records than :mod:`benchmarks.procedure_pulls` can afford. What a station adds (temperature, moves, switching) is not
in it. True values are as there; of a bias shift it is zero.
"""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.procedure_truths import BAND_UG, SUPPLIES, TRUTHS, WARM_G, WARM_S
from inertial.dynamics.ratiometry import largest_departure
from inertial.dynamics.stability import ShortNoise, difference_error, short_noise, stability
from inertial.dynamics.warm_up import entered
from inertial.errors import NotIdentified
from pipelines.procedures.ratiometry import RatiometryPart, over_supply
from pipelines.procedures.recorded import noise_columns
from stations.plant.noise import UnitNoise
from stations.plant.preset import load_preset

HOUR_S, WARM_RECORD_S, WARM_HZ = 3600, 1200, 10
WINDOW_S, APART_S, WINDOW_HZ = 20.0, 100.0, 100.0
DWELL_S, MOVE_S, FACE_SIZE = 10.0, 5.5, 1000  # of a face at a voltage; samples at WINDOW_HZ
NAMES = {"sd_100s": "bias_stability_ug", "drift_h": "bias_drift_ug_h", "allan_100s": "bias_allan_100s_ug"}


def tell(name: str, rows: list[tuple[float, float, float, float]], true: float, lost: int = 0) -> None:
    """Pulls and the share of intervals that hold; rows of value, uncertainty, and the ends of the interval."""
    value, error, low, high = np.array(rows).T
    pulls = (value - true) / error
    print(
        f"{name}: n {len(pulls)}, not determined {lost}, mean {pulls.mean():+.2f}, sd {pulls.std(ddof=1):.3f}, 95 % interval "
        f"holds {100.0 * np.mean((low <= true) & (true <= high)):.1f} %",
        flush=True,
    )


def hours(units: int, seed: int) -> None:
    """Bias stability over an hour."""
    preset = load_preset("SF1500")
    plant: Any = SimpleNamespace(preset=preset)
    true = TRUTHS["bias_stability"](plant, 0)
    noise = UnitNoise(preset, [np.random.default_rng([seed, 1, k]) for k in range(units)])
    records = (1e6 * noise.sample(HOUR_S, 1.0)).reshape(HOUR_S, -1).T
    stabilities = [stability(one, 1.0) for one in records]
    for key, name in NAMES.items():
        rows = [
            (getattr(one, key), getattr(one, f"{key}_error"), *getattr(one, f"{key}_interval")) for one in stabilities
        ]
        tell(name, rows, true[name])


def warm_ups(units: int, seed: int) -> None:
    """Warm-up time of an exponential."""
    noise = UnitNoise(load_preset("SF1500"), [np.random.default_rng([seed, 2, k]) for k in range(units)])
    whole = 1e6 * noise.sample(WARM_RECORD_S * WARM_HZ, float(WARM_HZ))
    records = whole.reshape(WARM_RECORD_S, WARM_HZ, -1).mean(axis=1).T
    time = np.asarray(np.arange(WARM_RECORD_S) + 0.5, dtype=np.float64)
    clean, rows, lost = 1e6 * WARM_G * np.exp(-time / WARM_S), list[tuple[float, float, float, float]](), 0
    for one in records:
        try:
            entry = entered(time, clean + one, band=BAND_UG, window_s=10.0)
        except NotIdentified:
            lost += 1
            continue
        rows.append((entry.value, entry.error, entry.low, entry.high))
    tell("warm_up_s", rows, WARM_S * float(np.log(1e6 * WARM_G / BAND_UG)), lost)


def shifts(units: int, seed: int) -> None:
    """Difference of two windows, the noise pooled over both and three axes."""
    noise = UnitNoise(load_preset("SF1500"), [np.random.default_rng([seed, 3, k]) for k in range(units)])
    size, rows = round(WINDOW_S * WINDOW_HZ), list[tuple[float, float, float, float]]()
    before = 1e6 * noise.sample(size, WINDOW_HZ)
    noise.jump(APART_S - WINDOW_S)
    after = 1e6 * noise.sample(size, WINDOW_HZ)
    for k in range(units):
        each = [short_noise(part[:, k, i], WINDOW_HZ) for part in (before, after) for i in range(3)]
        white, flicker = (float(np.mean([getattr(one, name) for one in each])) for name in ("white", "flicker"))
        error = float(np.sqrt(np.sum([one.flicker_error**2 for one in each])) / len(each))
        u = difference_error(ShortNoise(white, flicker, error), WINDOW_S, APART_S)
        for value in after[:, k].mean(axis=0) - before[:, k].mean(axis=0):
            rows.append((float(value), u, float(value) - 1.96 * u, float(value) + 1.96 * u))
    tell("shock_bias_shift_ug", rows, 0.0)


def supplies(units: int, seed: int) -> None:
    """Both faces at five voltages; nothing follows the voltage."""
    noise = UnitNoise(load_preset("SF1500"), [np.random.default_rng([seed, 4, k]) for k in range(units)])
    part = RatiometryPart(kind="ratiometry", supplies_V=list(SUPPLIES), axes=["z"])
    own: list[list[dict[str, float]]] = [[] for _ in range(3 * units)]
    now = 0.0
    for volt in SUPPLIES:
        for side, force in enumerate((1.0, -1.0)):
            noise.jump(MOVE_S)
            now += MOVE_S + DWELL_S
            for rows, record in zip(
                own, (force + noise.sample(FACE_SIZE, WINDOW_HZ)).reshape(FACE_SIZE, -1).T, strict=True
            ):
                face = {"setting": volt, "side": float(side), "value": float(record.mean()), "measured_V": volt}
                face |= {"uncertainty": float(record.std(ddof=1)) / FACE_SIZE**0.5, "window_s": DWELL_S, "time_s": now}
                rows.append(face | noise_columns(short_noise(record, WINDOW_HZ)))
    names = ("supply_sensitivity_percent", "supply_zero_percent_fs", "supply_zero_ug_V")
    pulls: dict[str, list[tuple[float, float, float, float]]] = {name: [] for name in names}
    for rows in own:
        one = over_supply(part, pd.DataFrame(rows))
        for name, (value, error) in zip(
            names,
            (
                largest_departure(one.supply, one.sensitivity, one.own_error)[:2],
                largest_departure(one.supply, one.zero_g, one.own_zero_error)[:2],
                (one.slope_g_V, one.slope_error_g_V),
            ),
            strict=True,
        ):
            pulls[name].append((value, error, value - 1.96 * error, value + 1.96 * error))
    for name, rows in pulls.items():
        tell(name, rows, 0.0)


def main() -> None:
    """All of them."""
    units, seed = (int(sys.argv[k]) if len(sys.argv) > k else other for k, other in ((1, 200), (2, 2026)))
    for run in (hours, warm_ups, shifts, supplies):
        run(units, seed)


if __name__ == "__main__":
    main()
