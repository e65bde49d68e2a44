"""``python -m benchmarks.rotation compare|hidden|null``: rotation against 24 poses on one plant, and hidden effects by name.

compare : units of the same truths are measured in 24 orthogonal poses of ten seconds and by a rotation, through the simulated
    station; RMS errors of bias, scale and misalignment over those of the poses, truths within U (k = 2), station minutes
hidden, null : mechanisms in the table or the device that the model lacks, or none, and the classes that the judge names
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from benchmarks.slow_noise import kept, mean_of
from inertial.dynamics.missing_effects import DiagnosisInG
from inertial.dynamics.rotation import RotationFit
from inertial.dynamics.rotation_diagnosis import diagnose_rotation
from inertial.fits.wander import fit_lot_with_wander
from inertial.frames import force_from_angles
from inertial.state import State
from pipelines.archive import Archive
from pipelines.capture.capture import capture
from pipelines.jobs.recipes import load_recipe
from pipelines.procedures import PROCEDURES, parts_of
from pipelines.procedures.recorded import nominal_device, procedure_record
from pipelines.procedures.rotation_points import data_of
from pipelines.schedule.steps import steps
from schemas.lot import Lot, Unit
from schemas.progress import silent
from schemas.simulation import ReferenceErrors, Simulation
from schemas.station import StationConfig, load_station
from stations.opening import open_station
from stations.plant.device import stream
from stations.plant.hidden import HiddenEffect
from stations.plant.hidden.device import CubicTransfer, PendulousMass
from stations.plant.hidden.table import EncoderHarmonic, LevelError
from stations.plant.plant import Plant
from stations.plant.preset import load_preset

Array = np.ndarray
HEAD = 'name = "r"\ndevice = "{device}"\nlocal_gravity_m_s2 = 9.80665\ntemperatures_C = [25.0]\n'
POSES = 'poses = "orthogonal24"\nstatic_record_s = 0.0\neffects = ["bias", "scale", "misalignment"]\n'
SHORT = 'planes = ["xy", "yz"]\nrates_deg_s = [30.0]\n'
FAST = 'planes = ["xy", "yz"]\nrates_deg_s = [66.0]\ntimes = 2\nstand_s = 0.5\nlead_deg = 18.0\n'
TABLES = {
    "slow": (30.0, 30.0, SHORT),
    "fast": (66.0, 200.0, FAST),
}  # limits of the table in °/s and °/s², and the rotation's keys
TERMS = ("bias", "scale", "misalignment")
GROUPS = {"bias": [0, 4, 8], "scale": [1, 6, 11], "misalignment": [2, 3, 5, 7, 9, 10]}


@dataclass
class Late(HiddenEffect):
    """Axis x is late by a time that is short against the turn: the force of before, by its last change."""

    delay_s: float = 1e-3
    _last: Array | None = field(default=None, init=False)

    def output(self, force: Array, block: Any) -> Array:
        """The late force minus the force, on x."""
        own = force[..., 0]
        before = np.concatenate([own[:1] if self._last is None else self._last, own[:-1]])
        self._last = own[-1:].copy()
        out = np.zeros_like(force)
        step = float(np.median(np.diff(block.time))) if len(block.time) > 1 else 0.01
        out[..., 0] = -self.delay_s / step * (own - before)
        return out


@dataclass
class Bent(HiddenEffect):
    """A mass whose rest moves with the square of the load, and a bias that drifts."""

    quadratic: float = 0.0  # 1/g
    drift: float = 0.0  # g/s

    def output(self, force: Array, block: Any) -> Array:
        """What bends and what drifts, g."""
        return self.quadratic * force**2 + self.drift * block.time[:, None, None]


def captured(
    body: str, device: str, station: StationConfig, lot: Lot, hidden: Sequence[HiddenEffect] = ()
) -> tuple[Any, Any, Any]:
    """Recipe, readings and samples by record of a lot."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recipe.toml"
        path.write_text(HEAD.format(device=device) + body)
        recipe = load_recipe(str(path))
        records = Archive(str(Path(folder) / "archive")).capture("one")
        with open_station(station, lot, hidden=hidden) as opened:
            capture(opened, recipe, lot, records, progress=silent, events=records.events)
        readings = records.gathered("readings")
        samples = {k: list(records.samples([k])) for k in range(len(steps(recipe)))}
    return recipe, readings, samples


def minutes(readings: Any) -> float:
    """From the beginning of the first record to the end of the last, min."""
    return float((readings["start_s"] + readings["duration_s"]).max() - readings["start_s"].min()) / 60.0


def by_poses(device: str, station: StationConfig, lot: Lot) -> tuple[Array, Array, float]:
    """Bias and matrix (units, 12) in g and g/g with standard uncertainties, from 24 poses, and the minutes."""
    _, readings, samples = captured(POSES, device, station, lot)
    scale = load_preset(device).scale
    means, errors, states = [], [], []
    for unit in lot.units:
        own = [next(t for t in samples[k] if (t["unit"] == unit.serial).any()) for k in samples]
        own = [t[t["unit"] == unit.serial][["x", "y", "z"]].to_numpy(dtype=float) / scale for t in own]
        means.append([one.mean(axis=0) for one in own])
        errors.append([one.std(axis=0, ddof=1) / np.sqrt(len(one)) for one in own])
        states.append(readings[readings["unit"] == unit.serial].sort_values("record"))
    first = states[0]
    force = force_from_angles(*np.radians(first[["outer_deg", "inner_deg"]].to_numpy(dtype=float).T))
    middle = (first["start_s"] + 0.5 * first["duration_s"]).to_numpy(dtype=float)
    state = State(force=force, time=middle, temperature=np.full(len(middle), 25.0))
    lot_fit = fit_lot_with_wander(TERMS, state, np.array(means), np.array(errors))
    value, error = lot_fit.fit.coefficients, lot_fit.fit.standard_errors
    order = [[0, *(1 + (np.arange(3) - axis) % 3)] for axis in range(3)]  # own axis first, then the next ones
    pick = np.array(order)
    value, error = (np.take_along_axis(v, pick[None], axis=-1).reshape(len(value), -1) for v in (value, error))
    return value, error, minutes(readings)


def points_of(
    part: str, device: str, station: StationConfig, lot: Lot, hidden: Sequence[HiddenEffect] = ()
) -> tuple[Any, float]:
    """Points of a rotation, and the minutes."""
    body = f'[[procedures]]\nkind = "rotation"\nscale = {load_preset(device).scale}\n{part}'
    recipe, readings, samples = captured(body, device, station, lot, hidden)
    taken: list[Any] = [
        procedure_record(k, step.order, samples[k], readings[readings["record"] == k])
        for k, step in enumerate(steps(recipe))
        if step.order is not None
    ]
    procedure: Any = PROCEDURES["rotation"]
    return procedure.reduce(parts_of(recipe)[0], taken, nominal_device(readings)), minutes(readings)


def diagnosed(points: Any, unit: str, effects: Sequence[str]) -> DiagnosisInG[RotationFit]:
    """The verdict on a model of one unit."""
    return diagnose_rotation(data_of(points[points["unit"] == unit]), effects)


def by_rotation(part: str, device: str, station: StationConfig, lot: Lot) -> tuple[Array, Array, float]:
    """As :func:`by_poses`, from a rotation."""
    points, spent = points_of(part, device, station, lot)
    names = [name for a in "xyz" for name in (f"bias_{a}", *(f"matrix_{a}{b}" for b in "xyz"))]
    fits = [data_of(points[points["unit"] == u.serial]).model.fit(()) for u in lot.units]
    pairs = np.array([[fit.of(name) for name in names] for fit in fits])
    return pairs[..., 0], pairs[..., 1], spent


def truth(plant: Plant) -> Array:
    """Bias and matrix (units, 12) of the plant."""
    own = [plant.truth(serial) for serial in plant.serials]
    return np.array([np.column_stack([t.bias_g, t.matrix]).ravel() for t in own])


def lot_of(
    device: str, count: int, seed: int, speed: float = 30.0, acceleration: float = 30.0
) -> tuple[StationConfig, Lot]:
    """A station of the built-in kind with limits in °/s and °/s², and a lot, each with a seed of its own."""
    station = load_station()
    limits = station.limits.model_copy(update={"speed_deg_s": speed, "acceleration_deg_s2": acceleration})
    simulation = (station.simulation or Simulation()).model_copy(update={"seed": seed})
    station = station.model_copy(update={"simulation": simulation, "limits": limits})
    return station, Lot(units=[Unit(serial=f"B{k}", slot=k) for k in range(count)], device=device, seed=seed)


def compare(device: str, units: int, seed: int, table: str) -> None:
    """RMS errors, truths within U, minutes, on the built-in table or one that is faster."""
    speed, acceleration, part = TABLES[table]
    errors: dict[str, list[Array]] = {"poses": [], "rotation": []}
    held: dict[str, list[Array]] = {"poses": [], "rotation": []}
    spent: dict[str, float] = {}
    for k in range((units + 7) // 8):
        station, lot = lot_of(device, min(8, units - 8 * k), seed + k, speed, acceleration)
        begun = truth(Plant(station, lot))
        for name, off in errors.items():
            with kept() as noises:
                how = by_poses(device, station, lot) if name == "poses" else by_rotation(part, device, station, lot)
            value, error, spent[name] = how
            true = begun.copy()
            true[:, GROUPS["bias"]] += mean_of(noises)  # a bias is that of its record
            off.append(value - true)
            held[name].append(np.abs(value - true) <= 2.0 * error)
    print(
        f"{device}: {units} units; minutes {spent['poses']:.2f} poses, {spent['rotation']:.2f} rotation, "
        f"share {spent['rotation'] / spent['poses']:.3f}"
    )
    for name, columns in GROUPS.items():
        rms = {how: 1e6 * float(np.sqrt(np.mean(np.concatenate(e)[:, columns] ** 2))) for how, e in errors.items()}
        inside = {how: float(np.mean(np.concatenate(h)[:, columns])) for how, h in held.items()}
        print(
            f"  {name}: RMS error {rms['poses']:.1f} poses, {rms['rotation']:.1f} rotation µg/g, ratio "
            f"{rms['rotation'] / rms['poses']:.2f}; within U {inside['poses']:.3f} · {inside['rotation']:.3f}",
            flush=True,
        )


def hidden_worlds() -> dict[str, tuple[dict[str, Any], list[HiddenEffect], list[str], str]]:
    """Changes of the simulation, hidden mechanisms, the judged model, and a part's further keys, by the effect to be named."""
    both, size = ["second_order", "third_order"], 3e-4
    return {
        "encoder_eccentricity": ({}, [EncoderHarmonic(size=size)], both, ""),
        "encoder_second_harmonic": ({}, [EncoderHarmonic(size=size, order=2.0)], both, ""),
        "level": ({}, [LevelError(about_x=size, about_y=-size)], both, ""),
        "orthogonality": ({"reference_errors": ReferenceErrors(orthogonality_urad=1e6 * size)}, [], both, ""),
        "run_out": ({"wobble_urad": 1e6 * size}, [], both, ""),
        "second_order": ({}, [Bent(quadratic=size)], ["third_order"], ""),
        "third_order": ({}, [CubicTransfer(hardening=2.0 * size, spread=0.1)], ["second_order"], ""),
        "cross_quadratic": ({}, [PendulousMass(compliance=size, spread=0.1)], both, ""),
        "lag_of_axes": ({}, [Late()], both, ""),
        "bias_drift": ({}, [Bent(drift=1e-5)], both, ""),
    }


def judge(runs: int, seed: int, *, nothing: bool) -> int:
    """In how many runs the class named first holds the hidden effect, or nothing is named where nothing is hidden."""
    worlds = {"nothing": ({}, [], ["second_order", "third_order"], "")} if nothing else hidden_worlds()
    right = count = 0
    for number in range(runs):
        name = list(worlds)[number % len(worlds)]
        station, lot = lot_of("QA700", 1, seed + number)
        change, _, effects, part = worlds[name]
        simulation = station.simulation or Simulation()
        if name == "orthogonality":  # of which each station draws its own: one that is not near zero
            drawn = next(
                s
                for s in range(seed + number, 10**9, 1000)
                if abs(stream(s, "references").standard_normal(16)[3]) > 1.0
            )
            simulation = simulation.model_copy(update={"seed": drawn})
        turning = simulation.turning.model_copy(
            update={k: v for k, v in change.items() if k in type(simulation.turning).model_fields}
        )
        more = {k: v for k, v in change.items() if k in Simulation.model_fields}
        station = station.model_copy(update={"simulation": simulation.model_copy(update={"turning": turning, **more})})
        hidden = [] if nothing else hidden_worlds()[name][1]
        points, _ = points_of(part, "QA700", station, lot, hidden)
        told = diagnosed(points, "B0", effects)
        good = not told.classes if nothing else bool(told.classes) and name in told.classes[0].effects
        named = [" | ".join(one.effects) for one in told.classes]
        right, count = right + good, count + 1
        print(
            f"{name}: {'right' if good else 'WRONG'} {named}, adequate {told.adequate}, unexplained {told.unexplained}",
            flush=True,
        )
    print(f"{'nothing named' if nothing else 'in the class named first'}: {right} of {count}")
    return right


def main() -> None:
    """What is asked for."""
    reader = argparse.ArgumentParser()
    reader.add_argument("what", choices=["compare", "hidden", "null"])
    reader.add_argument("--device", default="SF1500")
    reader.add_argument("--units", type=int, default=200)
    reader.add_argument("--runs", type=int, default=100)
    reader.add_argument("--seed", type=int, default=5100)
    reader.add_argument("--table", choices=list(TABLES), default="slow")
    asked, begun = reader.parse_args(), time.process_time()
    if asked.what == "compare":
        compare(asked.device, asked.units, asked.seed, asked.table)
    else:
        judge(asked.runs, asked.seed, nothing=asked.what == "null")
    print(f"processor {time.process_time() - begun:.0f} s")


if __name__ == "__main__":
    main()
