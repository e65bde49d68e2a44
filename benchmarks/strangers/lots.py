"""A measured lot of a kind: drawn from a seed, with an effect of the size that is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from benchmarks.strangers import curves, faults, memories, noises
from benchmarks.strangers.devices import Devices, draw_devices, ordinary_noise
from benchmarks.strangers.kinds import KINDS, Change, Kind, Record, Scene
from benchmarks.strangers.station import Day, Floats, draw_day, draw_plan, force_of
from benchmarks.strangers.tables import dwell_table, history_table

FAMILIES = (noises, faults, curves, memories)  # the modules that register kinds
PLAN, DEVICES, LOT, FIRST, SECOND = range(5)
TINY = 1e-5


@dataclass(frozen=True)
class Lot:
    """The dwells of a lot, those of another day of the same devices, and what is true of them."""

    dwells: pd.DataFrame
    history: pd.DataFrame | None
    fresh: pd.DataFrame
    fresh_history: pd.DataFrame | None
    truth: dict[str, Any]


def make(kind: str, seed: int, units: int = 8, size: float = 2.0) -> Lot:
    """A lot of a kind (a name of ``KINDS``).

    size : RMS of the effect, fault or strange noise in multiples of the noise of a dwell, over the dwells, units and axes
    where it is, after what coefficients of bias, sensitivity and their temperature would take up. Kinds whose size nature sets
    (``truth["scaled"]`` is false) state what it became.
    """
    what = KINDS[kind]
    plan = draw_plan(_stream(seed, PLAN), units, what.needs)
    devices = draw_devices(_stream(seed, DEVICES), units, plan.duration_s)
    days = [_Run(what, seed, tag, draw_day(_stream(seed, tag), plan), devices) for tag in (FIRST, SECOND)]
    first, second = days
    amplitude = first.amplitude(size) if what.scaled else 1.0
    dwells, history = first.tables(amplitude)
    truth = _truth(what, first, amplitude)
    fresh, fresh_history = second.tables(0.0 if what.world == "fault" else amplitude)
    return Lot(dwells, history, fresh, fresh_history, truth)


def _stream(seed: int, tag: int) -> np.random.Generator:
    return np.random.default_rng([seed, tag, 0x57A4])


class _Run:
    """A day of a kind: its noise, its change, and the tables at an amplitude."""

    def __init__(self, what: Kind, seed: int, tag: int, day: Day, devices: Devices) -> None:
        own = sum(ord(letter) * 31**place for place, letter in enumerate(what.name)) % 2**31
        noise = np.random.default_rng([seed, tag, own])
        self.day, self.devices = day, devices
        self.noise = ordinary_noise(noise, day, devices)
        self.change: Change = what.change(Scene(day, devices, np.random.default_rng([seed, LOT, own]), noise))
        self.thermometer = devices.thermometer_sd * noise.standard_normal((len(day.angles), len(devices.serials)))
        self.scatter = noise.standard_normal(self.noise.shape)

    def force(self, amplitude: float) -> Floats:
        """Specific force (d, u, 3) on the units, g."""
        force = np.repeat(self.day.force[:, None, :], len(self.devices.serials), axis=1)
        if self.change.turn is None or not amplitude:
            return force
        turn = Rotation.from_rotvec(amplitude * self.change.turn.reshape(-1, 3))
        return turn.inv().apply(force.reshape(-1, 3)).reshape(force.shape)

    def record(self, amplitude: float) -> Record:
        """What is written down at an amplitude; nothing went wrong at zero."""
        day, shape = self.day, self.noise.shape[:2]
        temperature = day.mean(day.case)
        out = self.devices.ideal(self.force(amplitude), temperature) + self.noise
        if self.change.added is not None:
            out += amplitude * self.change.added
        record = Record(
            np.repeat(day.mean(day.t)[:, None], shape[1], axis=1),
            np.repeat(day.angles[:, None, :], shape[1], axis=1),
            temperature + self.thermometer,
            out * self.devices.scale,
            day.case + 0.0,
        )
        if self.change.alter is not None and amplitude:
            self.change.alter(record)
        return record

    def error(self, amplitude: float) -> Floats:
        """What the record has beyond the devices' ordinary equation at the recorded angles and temperatures (d, u, 3), g."""
        record, clean = self.record(amplitude), self.record(0.0)
        force = force_of(record.angles[..., 0], record.angles[..., 1])
        own = record.out / self.devices.scale - self.devices.ideal(force, record.temperature)
        before = force_of(clean.angles[..., 0], clean.angles[..., 1])
        return own - (clean.out / self.devices.scale - self.devices.ideal(before, clean.temperature))

    def left(self, values: Floats) -> Floats:
        """What an ordinary calibration of each axis does not take up of values (d, u, 3)."""
        force, warm = self.day.force, self.day.mean(self.day.case) - 25.0
        result = np.empty_like(values)
        for unit in range(values.shape[1]):
            theta = warm[:, unit : unit + 1]
            for axis in range(3):
                parts = [np.ones_like(theta), force]
                parts += [theta, theta * force[:, axis : axis + 1]] if self.day.plan.thermal else []
                base = np.linalg.qr(np.hstack(parts))[0]
                column = values[:, unit, axis]
                result[:, unit, axis] = column - base @ (base.T @ column)
        return result

    @property
    def sigma(self) -> float:
        """RMS of the ordinary noise of a dwell, g."""
        count = len(self.noise)
        freedom = count - (6 if self.day.plan.thermal else 4)
        return float(np.sqrt(np.mean(self.left(self.noise) ** 2) * count / freedom))

    def by_axis(self, amplitude: float) -> Floats:
        """RMS (3,) of what the change leaves in the dwells and units where it is, g; 0 in axes that have none."""
        left = self.left(self.error(amplitude))
        units = list(range(left.shape[1])) if self.change.units is None else list(self.change.units)
        dwells = list(range(len(left))) if self.change.dwells is None else list(self.change.dwells)
        there = left[np.ix_(dwells, units)]
        axes = np.sqrt(np.mean(there**2, axis=(0, 1)))
        return np.where(axes > 0.05 * axes.max(), axes, 0.0)

    def rms(self, amplitude: float) -> float:
        """RMS of what the change leaves where it is, g."""
        axes = self.by_axis(amplitude)
        return float(np.sqrt(np.mean(axes[axes > 0.0] ** 2))) if axes.any() else 0.0

    def amplitude(self, size: float) -> float:
        """The amplitude at which the change has the size that is asked for."""
        amplitude = TINY
        for _ in range(3):
            amplitude *= size * self.sigma / self.rms(amplitude)
        return amplitude

    def tables(self, amplitude: float) -> tuple[pd.DataFrame, pd.DataFrame | None]:
        """Dwells and history at an amplitude."""
        record = self.record(amplitude)
        samples = self.devices.rate_hz * self.day.plan.duration_s
        sd = np.broadcast_to(self.devices.sample_sd, self.noise.shape)
        if self.change.sample_sd is not None:
            sd = np.hypot(sd, amplitude * self.change.sample_sd)
        sd = sd * (1.0 + self.scatter / np.sqrt(2.0 * samples))
        history = history_table(self.day, self.devices, record) if self.day.plan.history else None
        return dwell_table(self.day, self.devices, record, sd), history


def _truth(what: Kind, run: _Run, amplitude: float) -> dict[str, Any]:
    """What is true of the first day; ``size`` is what came out, in multiples of ``noise_ug``."""
    units = range(len(run.devices.serials)) if run.change.units is None else run.change.units
    dwells = range(len(run.day.angles)) if run.change.dwells is None else run.change.dwells
    none = what.world == "null"
    return {
        "kind": what.world,
        "name": what.name,
        "text": (what.change.__doc__ or "").strip(),
        "units": [] if none else [run.devices.serials[unit] for unit in sorted(units)],
        "dwells": [] if none else [int(dwell) + 1 for dwell in dwells],
        "axes": [axis for axis, rms in zip("xyz", run.by_axis(amplitude), strict=True) if rms > 0.0],
        "size": 0.0 if none else run.rms(amplitude) / run.sigma,
        "scaled": what.scaled,
        "noise_ug": 1e6 * run.sigma,
        "same_in_all_units": run.change.turn is not None and run.change.units is None,
        "catalogue": list(what.catalogue),
        **run.change.notes,
    }
