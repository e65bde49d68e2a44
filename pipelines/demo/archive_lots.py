"""Lots of a simulated line over months, dwell by dwell, for the demonstration of discoveries in an archive.

The physics is written here and knows no column of a fit: a proof mass on a spring that hardens, a table that rests a little off
its targets, wander from an Ornstein-Uhlenbeck cascade. What is hidden is a harder spring in the devices of one wafer.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial import poses
from inertial.frames import force_from_angles
from pipelines.archive import Archive, code_hash, files, stage_key
from pipelines.archive.keys import digest

Array = NDArray[np.float64]

STATIONS = ("line-1", "line-2", "line-3")
SOAKS_C = (-10.0, 25.0, 60.0)
POSES = 24
DWELL_S, MOVE_S, SOAK_S = 10.0, 6.0, 2400.0
WHITE_UG = 8.0  # of a dwell mean
_TAU_S = (100.0, 800.0, 6400.0)


@dataclass(frozen=True)
class Hidden:
    """The hidden physics: the spring of the devices of one wafer.

    hardening : k₃ of a restoring force x + k₃x³, 1/g²: the output falls behind a force f by about k₃f³
    """

    wafer: str = "W07"
    hardening: float = 12e-6


@dataclass
class Line:
    """A line that measures lots day by day.

    units : of a lot · wafers : how many are in use at a time · hidden : None for a line without anything hidden
    rests : rad, how far the table rests off its targets, each time anew · wander : µg
    """

    seed: int
    units: int = 8
    wafers: int = 12
    hidden: Hidden | None = field(default_factory=Hidden)
    rests: float = 15e-6
    wander: float = 12.0

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng([self.seed, 733])
        self._angles = np.array(poses.plan(f"fibonacci{POSES}"))
        self._number = 0

    def lot(self, station: str) -> tuple[pd.DataFrame, pd.DataFrame]:
        """The next lot: its dwells in the exchange format, and for each unit serial, slot, wafer and firmware."""
        rng, number = self._rng, self._number
        self._number += 1
        serials = [f"D{number:04d}-{k}" for k in range(self.units)]
        wafers = rng.integers(1, self.wafers + 1, self.units)
        about = pd.DataFrame({"unit": serials, "slot": range(self.units), "wafer": [f"W{w:02d}" for w in wafers]})
        about["station"] = station
        angles = np.concatenate([self._angles[rng.permutation(POSES)] for _ in SOAKS_C])  # another order in each soak
        soak = np.repeat(np.arange(len(SOAKS_C)), POSES)
        time = self._times(soak)
        rest = angles + np.degrees(self.rests) * rng.standard_normal(angles.shape)  # where the table really rests
        force = _force(rest)
        chamber = np.array(SOAKS_C)[soak]
        frames = [
            self._unit(serial, str(wafer), force, time, chamber + 0.05 * rng.standard_normal())
            for serial, wafer in zip(serials, about["wafer"], strict=True)
        ]
        stated = _force(angles)
        common = {
            "dwell": np.arange(len(soak)),
            "time_s": time,
            "outer_deg": angles[:, 0],
            "inner_deg": angles[:, 1],
            **{f"force_{a}": stated[:, k] for k, a in enumerate("xyz")},
            "chamber_C": chamber,
        }
        tables = [
            pd.DataFrame({"unit": s, "slot": k, **common, **frame})
            for k, (s, frame) in enumerate(zip(serials, frames, strict=True))
        ]
        dwells = pd.concat(tables, ignore_index=True)
        dwells["n"], dwells["out_unit"] = 1000, "g"
        return dwells, about

    def _times(self, soak: NDArray[np.intp]) -> Array:
        step = np.full(soak.size, DWELL_S + MOVE_S)
        step[0] = 0.0
        step[1:] += SOAK_S * (np.diff(soak) > 0)
        return np.cumsum(step)

    def _unit(self, serial: str, wafer: str, force: Array, time: Array, temperature: Array) -> dict[str, Array | str]:
        """Output of a device, g, of spring, misalignment, bias and scale that follow its temperature, noise."""
        rng = self._rng
        turned = np.eye(3) + 2e-3 * rng.standard_normal((3, 3))
        along = force @ turned.T
        hidden = self.hidden
        if hidden is not None and wafer == hidden.wafer:
            along = _deflection(along, hidden.hardening)
        warm = (temperature - 25.0)[:, None]
        out = along * (1.0 + 5e-3 * rng.standard_normal(3) + 40e-6 * rng.standard_normal(3) * warm)
        out = out + 10e-3 * rng.standard_normal(3) + 40e-6 * rng.standard_normal(3) * warm
        out += 1e-6 * WHITE_UG * rng.standard_normal(out.shape) + 1e-6 * self.wander * _wander(rng, time)
        sd = 1e-6 * WHITE_UG * math.sqrt(1000.0) * np.sqrt(rng.chisquare(999, out.shape) / 999.0)
        values = {f"out_{a}": out[:, k] for k, a in enumerate("xyz")}
        return {**values, **{f"sd_{a}": sd[:, k] for k, a in enumerate("xyz")}, "unit_C": temperature}


def _force(angles: Array) -> Array:
    """Specific force (n, 3), g, at the angles of a table with a horizontal outer axis."""
    return force_from_angles(*np.radians(angles).T)


def _deflection(force: Array, hardening: float) -> Array:
    """Deflection x of a proof mass with x + k₃x³ = f, by Newton's method."""
    x = force.copy()
    for _ in range(6):
        x -= (x + hardening * x**3 - force) / (1.0 + 3.0 * hardening * x**2)
    return x


def _wander(rng: np.random.Generator, time: Array) -> Array:
    """Wander (n, 3) of three Ornstein-Uhlenbeck processes of unit variance in all."""
    total, gaps = np.zeros((time.size, 3)), np.diff(time, prepend=time[:1])
    for tau in _TAU_S:
        state, *steps = rng.standard_normal((1 + time.size, 3))
        kept, new = np.exp(-gaps / tau), np.sqrt(-np.expm1(-2.0 * gaps / tau))
        for k, step in enumerate(steps):
            state = kept[k] * state + new[k] * step
            total[k] += state
    return total / math.sqrt(len(_TAU_S))


EFFECTS = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
DEVICE = "DEMO"
A_NIGHT = 20
BEGIN = datetime(2026, 1, 5, 6, tzinfo=UTC)


@dataclass(frozen=True)
class DemoArchive:
    """The files written: the archive, and the table of the attributes of its units."""

    folder: Path
    units: Path
    lots: int


def write_lots(folder: Path, line: Line, lots: int, progress: Callable[[int], None] = lambda _: None) -> DemoArchive:
    """Write lots of a line as runs of an archive, and ``units.csv`` with the wafer of each unit beside it.

    progress : is told the number of lots that are written
    """
    archive = Archive(str(folder / "archive"))
    archive.prepare()
    known: list[pd.DataFrame] = []
    for number in range(lots):
        station = STATIONS[number % len(STATIONS)]
        dwells, about = line.lot(station)
        known.append(about[["unit", "wafer"]].rename(columns={"unit": "serial"}))
        write_run(archive, number, station, dwells, about)
        progress(number + 1)
    units = folder / "units.csv"
    files.publish(units, pd.concat(known, ignore_index=True).to_csv(index=False).encode(), "demo", files.ELSEWHERE)
    return DemoArchive(folder / "archive", units, lots)


def write_run(archive: Archive, number: int, station: str, dwells: pd.DataFrame, about: pd.DataFrame) -> None:
    """One run: its dwells, as an import of a simulated lot."""
    when = BEGIN + timedelta(days=number // A_NIGHT, minutes=40 * (number % A_NIGHT))
    units = [{"serial": str(s), "slot": int(k)} for s, k in zip(about["unit"], about["slot"], strict=True)]
    described = {
        "when": when.isoformat(timespec="seconds"),
        "name": f"simulated lot {number}",
        "lot": {"device": DEVICE, "units": units},
        "station": {"name": station, "kind": "simulated"},
        "recipe": {"name": "line", "effects": list(EFFECTS), "formulas": [], "model_name": "", "model_version": 0},
    }
    inputs, code = {"source": digest({"lot": number, "units": units})}, code_hash("import")
    key = stage_key("import", inputs, {"simulated": number}, code)
    run = archive.open_run("line", described, {"key": key})
    run.save("import", key, {"dwells": dwells}, {"inputs": inputs, "parameters": {"simulated": number}, "code": code})
    run.seal()
