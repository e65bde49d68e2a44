"""What a capture gathers while it runs, and the tables it makes of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from schemas.recipe import Pose, Unit
    from stations.devices.reader import Instruments
    from stations.devices.slot import Identity, Samples

AXES = ("x", "y", "z")


@dataclass
class History:
    """Temperatures against time since the last record was stored."""

    rows: list[tuple[float, float, int, str, float]] = field(default_factory=list)
    last: float | None = None
    air: float = math.nan

    def due(self, now: float, every: float) -> bool:
        """Whether the last row is old enough."""
        return self.last is None or now - self.last >= every - 1e-6

    def add(self, now: float, chamber: float, units: Sequence[Unit], by_slot: Sequence[float]) -> None:
        """Notes the temperatures of air and devices."""
        self.last, self.air = now, chamber
        self.rows += [(now, chamber, unit.slot, unit.serial, by_slot[unit.slot]) for unit in units]

    def taken(self) -> pd.DataFrame:
        """The rows as a table; the next record starts with none, due at once, so that a resumed run notes the same."""
        frame = pd.DataFrame(self.rows, columns=["time_s", "chamber_C", "slot", "unit", "unit_C"])
        self.rows, self.last = [], None
        return frame


@dataclass
class Approach:
    """How air and devices come to a soak's target: where they began, and how far beyond it they went."""

    target: float
    first: tuple[float, float] | None = None
    air_K: float = 0.0
    devices_K: float = 0.0

    def look(self, air: float, devices: Sequence[float]) -> None:
        """Notes the temperatures of one instant, °C."""
        known = [t for t in devices if math.isfinite(t)] or [self.target]
        if self.first is None:
            self.first = (air, sum(known) / len(known))
        self.air_K = max(self.air_K, self._beyond(self.first[0], air))
        self.devices_K = max(self.devices_K, *(self._beyond(self.first[1], t) for t in known))

    def figures(self) -> dict[str, float]:
        """Overshoot of air and devices for the journal, K."""
        return {"air_overshoot_K": round(self.air_K, 4), "device_overshoot_K": round(self.devices_K, 4)}

    def _beyond(self, begin: float, now: float) -> float:
        """How far ``now`` lies behind the target, seen from where it began; 0 before it, or where air is not known."""
        far = math.copysign(1.0, self.target - begin) * (now - self.target)
        return max(0.0, far)


@dataclass
class Record:
    """One record while it is taken: what was looked at, and the samples by unit."""

    number: int
    kind: str
    pose: Pose
    soak: int
    start: float
    duration: float
    rate: float
    since_move: float = 0.0
    since_power: float = 0.0
    angles: list[tuple[float, float]] = field(default_factory=list)
    chamber: list[float] = field(default_factory=list)
    instruments: list[Instruments] = field(default_factory=list)
    parts: dict[str, list[Samples]] = field(default_factory=dict)

    def look(self, angles: tuple[float, float], chamber: float, instruments: Instruments) -> None:
        """Notes encoders, air and instruments of one instant."""
        self.angles.append(angles)
        self.chamber.append(chamber)
        self.instruments.append(instruments)

    def keep(self, serial: str, samples: Samples) -> None:
        """Adds samples of a unit."""
        self.parts.setdefault(serial, []).append(samples)

    def count(self, serial: str) -> int:
        """Samples of a unit so far."""
        return sum(len(part.outputs) for part in self.parts.get(serial, []))

    def overflow(self, serial: str) -> bool:
        """Whether samples of a unit were lost."""
        return any(part.overflow for part in self.parts.get(serial, []))

    def samples(self, units: Sequence[Unit]) -> pd.DataFrame:
        """The samples of these units, one row each; a sample's time follows from its number since the start."""
        units = [unit for unit in units if self.count(unit.serial)]
        counts = [self.count(unit.serial) for unit in units]
        numbers = [_numbers(self.parts[unit.serial]) for unit in units]
        outputs = [part.outputs for unit in units for part in self.parts[unit.serial]]
        table = np.concatenate(outputs) if outputs else np.zeros((0, 3))
        since = np.concatenate(numbers) if numbers else np.zeros(0)
        columns: dict[str, Any] = {
            "unit": pd.Series([u.serial for u in units], dtype="str").repeat(counts).reset_index(drop=True),
            "slot": np.repeat(np.array([u.slot for u in units], dtype=np.int64), counts),
            "record": np.full(len(table), self.number, dtype=np.int64),
            "kind": pd.Series([self.kind], dtype="str").repeat(len(table)).reset_index(drop=True),
            "time_s": self.start + (since + 1.0) / self.rate,
        }
        return pd.DataFrame(columns | {axis: table[:, i] for i, axis in enumerate(AXES)})


def _numbers(parts: Sequence[Samples]) -> NDArray[np.float64]:
    """Numbers of samples since the start, from 0."""
    return np.concatenate([part.first + np.arange(len(part.outputs), dtype=np.float64) for part in parts])


def readings_row(record: Record, unit: Unit, identity: Identity, status: str) -> dict[str, object]:
    """What the station read beside a unit's samples: means over the looks of a record."""
    outer, inner = np.mean(record.angles, axis=0)
    looks = record.instruments
    return {
        "unit": unit.serial,
        "slot": unit.slot,
        "record": record.number,
        "kind": record.kind,
        "pose": record.pose.name,
        "soak": record.soak,
        "outer_deg": float(outer),
        "inner_deg": float(inner),
        "outer_command_deg": record.pose.outer_deg,
        "inner_command_deg": record.pose.inner_deg,
        "chamber_C": float(np.mean(record.chamber)),
        "unit_C": float(np.mean([look.temperature_C[unit.slot] for look in looks])),
        "supply_V": float(np.mean([look.supply_V[unit.slot] for look in looks])),
        "vibration_g": float(np.mean([look.vibration_g for look in looks])),
        "since_move_s": record.since_move,
        "since_power_s": record.since_power,
        "start_s": record.start,
        "duration_s": record.duration,
        "rate_hz": record.rate,
        "n": record.count(unit.serial) if status == "ok" else 0,
        "overflow": record.overflow(unit.serial),
        "status": status,
        "out_unit": identity.out_unit,
        "full_scale": identity.full_scale,
    }
