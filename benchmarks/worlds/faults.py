"""What goes wrong at a station: each takes the scene as it was and gives it as it is, and tells what was done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

Floats = np.ndarray
Done = tuple[Any, Floats | None, Floats, Floats, "Told | tuple[Told, ...] | None"]


@dataclass(frozen=True)
class Told:
    """The truth: names under which it may be told, the units (empty: all) and dwells it touches."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    dwells: tuple[int, ...]


def bad_dwell(scene: Any, readings: Floats, noise: Floats, amount: float, rng: np.random.Generator) -> Done:
    """One dwell of one unit is off by ``amount`` mg in a random direction."""
    unit, dwell = int(rng.integers(len(noise))), int(rng.integers(2, noise.shape[1] - 2))
    way = rng.standard_normal(3)
    noise = noise.copy()
    noise[unit, dwell] += 1e-3 * amount * way / np.linalg.norm(way)
    return scene, None, readings, noise, Told(("bad_dwell",), (f"W{unit + 1:03d}",), (dwell,))


def two_dwells(scene: Any, readings: Floats, noise: Floats, amount: float, rng: np.random.Generator) -> Done:
    """Two dwells of one unit are off by ``amount`` mg in random directions."""
    unit = int(rng.integers(len(noise)))
    noise, told = noise.copy(), []
    for dwell in rng.choice(np.arange(2, noise.shape[1] - 2), 2, replace=False).tolist():
        way = rng.standard_normal(3)
        noise[unit, dwell] += 1e-3 * amount * way / np.linalg.norm(way)
        told.append(Told(("bad_dwell",), (f"W{unit + 1:03d}",), (dwell,)))
    return scene, None, readings, noise, tuple(told)


def dwell_of_moved(scene: Any, readings: Floats, noise: Floats, amount: float, rng: np.random.Generator) -> Done:
    """A unit turns by 0.2 mrad, and a dwell of the same unit is off by ``amount`` mg."""
    _, turned, _, noise, moved = unit_moved(scene, readings, noise, 0.2, rng)
    assert isinstance(moved, Told)
    unit, dwell, way = int(moved.units[0][1:]) - 1, int(rng.integers(2, noise.shape[1] - 2)), rng.standard_normal(3)
    noise = noise.copy()
    noise[unit, dwell] += 1e-3 * amount * way / np.linalg.norm(way)
    return scene, turned, readings, noise, (moved, Told(("bad_dwell",), moved.units, (dwell,)))


def unit_moved(scene: Any, readings: Floats, noise: Floats, amount: float, rng: np.random.Generator) -> Done:
    """One unit turns by ``amount`` mrad about a random axis in the middle third of the run."""
    unit, n = int(rng.integers(len(noise))), noise.shape[1]
    at = int(rng.integers(n // 3, 2 * n // 3))
    way = rng.standard_normal(3)
    turned = np.zeros(noise.shape)
    turned[unit, at:] = 1e-3 * amount * way / np.linalg.norm(way)
    names = ("unit_moved", "misalignment_temperature") if len(noise) == 1 else ("unit_moved",)
    return scene, turned, readings, noise, Told(names, (f"W{unit + 1:03d}",), (at,))


def units_swapped(scene: Any, readings: Floats, noise: Floats, amount: float, rng: np.random.Generator) -> Done:
    """Two units are exchanged after a soak, or within one; with an ``amount`` their thermometers go with them."""
    n = noise.shape[1]
    one, other = (int(u) for u in rng.choice(len(noise), 2, replace=False))
    at = int(rng.choice([np.flatnonzero(np.diff(scene.soak))[-1] + 1, rng.integers(n // 3, 2 * n // 3)]))
    pair, late = [one, other], slice(at, None)
    whole, noise = scene.output + noise, noise.copy()
    noise[pair, late] = whole[pair[::-1], late] - scene.output[pair, late]
    if amount:
        readings = readings.copy()
        readings[pair, late] = readings[pair[::-1], late]
    units = tuple(f"W{unit + 1:03d}" for unit in sorted(pair))
    return scene, None, readings, noise, Told(("units_swapped",), units, tuple(range(at, n)))


def thermometer(scene: Any, readings: Floats, noise: Floats, amount: float, rng: np.random.Generator) -> Done:
    """All thermometers of one soak read ``amount`` K too much."""
    soak = int(rng.integers(int(scene.soak.max()) + 1))
    wrong = scene.soak == soak
    return (
        scene,
        None,
        readings + amount * wrong,
        noise,
        Told(("soak_thermometer",), (), tuple(np.flatnonzero(wrong).tolist())),
    )


def wrong_pose(scene: Any, readings: Floats, noise: Floats, amount: float, rng: np.random.Generator) -> Done:
    """The table stands ``amount`` degrees off in one dwell, for all units."""
    dwell = int(rng.integers(2, noise.shape[1] - 2))
    way = rng.uniform(0.0, 2.0 * np.pi)
    off = np.zeros(noise.shape[1])
    off[dwell] = np.radians(amount)
    scene = replace(scene, outer=scene.outer + np.cos(way) * off, inner=scene.inner + np.sin(way) * off)
    return scene, None, readings, noise, Told(("wrong_pose",), (), (dwell,))


def pose_off(scene: Any, readings: Floats, noise: Floats, amount: float, rng: np.random.Generator) -> Done:
    """The table stands ``amount`` degrees off in every dwell of one pose, for all units."""
    chosen, way = int(rng.integers(noise.shape[1])), rng.uniform(0.0, 2.0 * np.pi)
    here = np.linalg.norm(scene.force - scene.force[chosen], axis=-1) < 1e-6
    off = np.radians(amount) * here
    scene = replace(scene, outer=scene.outer + np.cos(way) * off, inner=scene.inner + np.sin(way) * off)
    return scene, None, readings, noise, Told(("pose_off",), (), tuple(np.flatnonzero(here).tolist()))


def table_slip(scene: Any, readings: Floats, noise: Floats, amount: float, rng: np.random.Generator) -> Done:
    """The table slips on its drives by ``amount`` mrad in the middle third of the run."""
    n = noise.shape[1]
    at, way = int(rng.integers(n // 3, 2 * n // 3)), rng.uniform(0.0, 2.0 * np.pi)
    after = 1e-3 * amount * (np.arange(n) >= at)
    scene = replace(scene, outer=scene.outer + np.cos(way) * after, inner=scene.inner + np.sin(way) * after)
    return scene, None, readings, noise, Told(("table_slip",), (), (at,))


def unsoaked(scene: Any, readings: Floats, noise: Floats, amount: float, rng: np.random.Generator) -> Done:
    """The devices are not soaked, and what is read is the chamber's air."""
    return scene, None, scene.chamber + 1.0, noise, Told(("thermal_lag", "device_not_soaked"), (), ())


def unit_unsoaked(scene: Any, readings: Floats, noise: Floats, amount: float, rng: np.random.Generator) -> Done:
    """The reading of one unit is the chamber's, and its soaks were too short for it; the others read their own."""
    unit = int(rng.integers(len(noise)))
    readings = readings.copy()
    readings[unit] = scene.chamber[unit] + 1.0
    return scene, None, readings, noise, Told(("unit_not_soaked",), (f"W{unit + 1:03d}",), ())


FAULTS: dict[str, Callable[..., Done]] = {
    "bad_dwell": bad_dwell,
    "two_dwells": two_dwells,
    "dwell_of_moved": dwell_of_moved,
    "unit_unsoaked": unit_unsoaked,
    "unit_moved": unit_moved,
    "units_swapped": units_swapped,
    "thermometer": thermometer,
    "wrong_pose": wrong_pose,
    "pose_off": pose_off,
    "table_slip": table_slip,
    "unsoaked": unsoaked,
}
