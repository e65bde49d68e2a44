"""A simulated factory: units that drift over years, stations whose level changes, and their dwells.

The physics is that of the simulated plant (:mod:`stations.plant`), not the columns of the fit or the statistics of the audit;
the truth of every unit and station is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from stations.plant.device import PlantDevices, Truth, draw_truth, rotate, rotation, stream
from stations.plant.hidden.table import LevelError
from stations.plant.preset import Preset, load_preset

YEAR_D = 365.25
STATIONS = ("line-1", "line-2", "line-3", "line-4")
PER_LOT = 10
SLOTS = 12
CHECK_SLOT = 10
DEVICES = ("ADXL355", "ADXL355", "SF1500")  # two lots of the first type for one of the second
SLOPE_UG = {"ADXL355": 60.0, "SF1500": 20.0}  # per year, one sigma over units
WALK_UG = {"ADXL355": 40.0, "SF1500": 15.0}  # per root year
SCALE_SLOPE_PPM = 25.0
MOUNT_RAD, MOUNT_UG = 100e-6, 30.0  # change by reseating a unit
TAU_S = (30.0, 300.0, 3000.0)  # time constants of the drift between dwells

LEVEL_STATION, LEVEL_AT, LEVEL_RAD = "line-2", 0.8, 300e-6
KNOCKED_STATION, KNOCKED_SLOT, KNOCKED_AT, KNOCKED_RAD = "line-3", 4, 0.5, 1.5e-3
SWAP_AT, BAD_LOT_AT, GAUGE_AT = 0.7, 0.4, 0.55
DRIFTING_UG = 900.0  # per year, on x
BAD_LOT_G = 0.03
GAUGE_MOUNTS, GAUGE_STATIONS, GAUGE_FEWEST_LOTS = 3, 3, 400


@dataclass
class FactoryUnit:
    """One unit: its initial state and its drift."""

    truth: Truth
    device: str
    born_d: float
    slope_ug: np.ndarray
    scale_slope_ppm: np.ndarray
    walk_ug: np.ndarray = field(default_factory=lambda: np.zeros(3))
    last_d: float = 0.0

    def at(self, day: float, rng: np.random.Generator) -> Truth:
        """The state of the unit on a day; days must be in order."""
        years = (day - self.born_d) / YEAR_D
        since = max(day - self.last_d, 0.0) / YEAR_D
        self.walk_ug = self.walk_ug + WALK_UG[self.device] * math.sqrt(since) * rng.standard_normal(3)
        self.last_d = day
        return replace(
            self.truth,
            bias_g=self.truth.bias_g + 1e-6 * (self.slope_ug * years + self.walk_ug),
            scale_ppm=self.truth.scale_ppm + self.scale_slope_ppm * years,
        )


@dataclass
class Lot:
    """One lot: station, day, units, slots, serials, and the true state on that day."""

    number: int
    day: float
    station: str
    device: str
    kind: str
    serials: list[str]
    slots: list[int]
    truths: list[Truth]
    up: np.ndarray


class Factory:
    """All lots of some years, in order of time; the same for the same seed."""

    def __init__(self, lots: int, years: float, seed: int) -> None:
        self.count, self.days, self.seed = lots, years * YEAR_D, seed
        self.rng = stream(seed, "factory")
        self.presets = {name: load_preset(name) for name in set(DEVICES)}
        self.level = {s: 60e-6 * self.rng.standard_normal(2) for s in STATIONS}
        self.slots = {s: 1e-3 * self.rng.standard_normal((SLOTS, 3)) for s in STATIONS}
        self.units: dict[str, FactoryUnit] = {}
        self.queue: list[list[str]] = []
        self.events: dict[str, object] = {}
        self.checked: dict[str, float] = {}
        for station in STATIONS:
            self._make(f"CS-{station}", "ADXL355", 0.0, quiet=0.1)

    def lots(self) -> list[Lot]:
        """Every lot with its truth."""
        pool = max(3, self.count // 20)
        gauge = self._gauge() if self.count >= GAUGE_FEWEST_LOTS else {}
        out = []
        for number in range(self.count):
            day = self.days * (number + 0.5) / self.count
            self._station_events(day)
            station = STATIONS[number % len(STATIONS)]
            if number < pool:
                out.append(self._new(number, day, station, DEVICES[number % len(DEVICES)], pooled=True))
            elif number in gauge:
                out.append(self._again(number, day, gauge[number], [*self._gauged()], "gauge"))
            elif number % 2:
                out.append(self._new(number, day, station, DEVICES[(number // 2) % len(DEVICES)], pooled=False))
            else:
                out.append(self._again(number, day, station, self._next_group(), "recalibration"))
        return out

    def _gauge(self) -> dict[int, str]:
        """Lots of a gauge study: the same units on three stations, three times, in consecutive lots."""
        first = int(GAUGE_AT * self.count)
        mounts = GAUGE_STATIONS * GAUGE_MOUNTS
        self.events["gauge"] = {"first_lot": first, "lots": mounts}
        return {first + k: STATIONS[k % GAUGE_STATIONS] for k in range(mounts)}

    def _gauged(self) -> list[str]:
        return [s for s, unit in self.units.items() if unit.device == "ADXL355" and s.startswith("P")][:PER_LOT]

    def _station_events(self, day: float) -> None:
        if day >= LEVEL_AT * self.days and "level" not in self.events:
            self.level[LEVEL_STATION] = self.level[LEVEL_STATION] + np.array([LEVEL_RAD, 0.0])
            self.events["level"] = {"station": LEVEL_STATION, "day": LEVEL_AT * self.days, "by_rad": LEVEL_RAD}
        if day >= KNOCKED_AT * self.days and "slot" not in self.events:
            self.slots[KNOCKED_STATION][KNOCKED_SLOT, 2] += KNOCKED_RAD
            where = {"station": KNOCKED_STATION, "slot": KNOCKED_SLOT}
            self.events["slot"] = {**where, "day": KNOCKED_AT * self.days, "by_rad": KNOCKED_RAD}

    def _make(self, serial: str, device: str, day: float, quiet: float = 1.0) -> FactoryUnit:
        rng = stream(self.seed, serial, "ageing")
        preset = self.presets[device]
        truth = draw_truth(
            preset, serial, self.seed, slot_rotation=np.eye(3), supply_ratio=1.0, output_scale=preset.scale
        )
        slope = quiet * SLOPE_UG[device] * rng.standard_normal(3)
        made = FactoryUnit(truth, device, day, slope, quiet * SCALE_SLOPE_PPM * rng.standard_normal(3), last_d=day)
        self.units[serial] = made
        return made

    def _new(self, number: int, day: float, station: str, device: str, *, pooled: bool) -> Lot:
        serials = [f"{'P' if pooled else 'N'}{number:05d}-{place}" for place in range(PER_LOT)]
        bad = not pooled and day >= BAD_LOT_AT * self.days and "bad_lot" not in self.events
        for serial in serials:
            made = self._make(serial, device, day)
            if bad:
                made.truth = replace(made.truth, bias_g=made.truth.bias_g + BAD_LOT_G)
        if bad:
            self.events["bad_lot"] = {"lot": number, "bias_by_g": BAD_LOT_G}
        if pooled and "drifting" not in self.events:
            self.units[serials[3]].slope_ug[0] = DRIFTING_UG
            self.events["drifting"] = {"unit": serials[3], "parameter": "bias x", "ug_per_year": DRIFTING_UG}
        return self._measured(number, day, station, serials, "production")

    def _next_group(self) -> list[str]:
        """The next ten units due of one type; every round distributes them again over stations and slots."""
        if not self.queue:
            for device in sorted(set(DEVICES)):
                known = [s for s, unit in self.units.items() if unit.device == device and s.startswith("P")]
                mixed = [str(s) for s in self.rng.permutation(known)]
                self.queue += [mixed[k : k + PER_LOT] for k in range(0, len(mixed), PER_LOT)]
            self.rng.shuffle(self.queue)
        return self.queue.pop()

    def _again(self, number: int, day: float, station: str, serials: list[str], kind: str) -> Lot:
        if kind == "gauge":
            serials = [str(s) for s in self.rng.permutation(serials)]
        lot = self._measured(number, day, station, serials, kind)
        if kind == "recalibration" and day >= SWAP_AT * self.days and "swap" not in self.events:
            lot.serials[2], lot.serials[5] = lot.serials[5], lot.serials[2]
            self.events["swap"] = {"lot": number, "units": [lot.serials[2], lot.serials[5]]}
        return lot

    def _measured(self, number: int, day: float, station: str, serials: list[str], kind: str) -> Lot:
        device, slots = self.units[serials[0]].device, list(range(len(serials)))
        check = f"CS-{station}"
        if device == "ADXL355" and kind != "gauge" and day - self.checked.get(station, -YEAR_D) >= 7.0:
            self.checked[station] = day
            serials, slots = [*serials, check], [*slots, CHECK_SLOT]
        truths = [
            self._seated(self.units[s].at(day, self.rng), station, slot) for s, slot in zip(serials, slots, strict=True)
        ]
        about_x, about_y = self.level[station]
        up = LevelError(about_x=about_x, about_y=about_y).up(np.array([0.0, 0.0, 1.0]))
        return Lot(number, day, station, device, kind, list(serials), slots, truths, up)

    def _seated(self, truth: Truth, station: str, slot: int) -> Truth:
        """A unit in a slot: the rotation of the slot, and the change by this seating."""
        turned = rotation(self.slots[station][slot] + MOUNT_RAD * self.rng.standard_normal(3))
        stress = 1e-6 * MOUNT_UG * self.rng.standard_normal(3)
        return replace(truth, slot_rotation=turned, bias_g=truth.bias_g + stress)


def lot_output(lot: Lot, preset: Preset, force: np.ndarray, temperature: np.ndarray) -> np.ndarray:
    """Output of the units of a lot without noise, (n, s, 3) in g.

    force : (n, 3), the vertical of the station in the frame of the fixture; temperature : (n, s), °C
    """
    turned = rotate(np.stack([t.slot_rotation for t in lot.truths]), force[:, None, :])
    return PlantDevices(preset, lot.truths).output(turned, temperature)


def table_force(outer_deg: np.ndarray, inner_deg: np.ndarray, up: np.ndarray) -> np.ndarray:
    """The vertical (3,) of the station in the frame of the fixture at table angles (n,), as (n, 3): two explicit rotations."""
    outer, inner = np.radians(outer_deg), np.radians(inner_deg)
    x, y, z = up
    y_out = y * np.cos(outer) + z * np.sin(outer)
    z_out = z * np.cos(outer) - y * np.sin(outer)
    return np.column_stack(
        [x * np.cos(inner) + y_out * np.sin(inner), y_out * np.cos(inner) - x * np.sin(inner), z_out]
    )


def dwell_noise(preset: Preset, time_s: np.ndarray, dwell_s: float, units: int, rng: np.random.Generator) -> np.ndarray:
    """Noise of the means of dwells, (n, units, 3) in g: white noise, and drift with correlation times from seconds to hours."""
    white = (
        1e-6 * preset.noise_density_ug * math.sqrt(1.0 / (2.0 * dwell_s)) * rng.standard_normal((time_s.size, units, 3))
    )
    step = 1e-6 * preset.bias_instability_ug * math.sqrt(math.log(TAU_S[1] / TAU_S[0]) / math.pi)
    draws = rng.standard_normal((time_s.size, units, 3, len(TAU_S)))
    keep = np.exp(-np.diff(time_s, prepend=time_s[0])[:, None] / np.array(TAU_S))
    state, wander = draws[0], np.empty_like(draws)
    for n in range(time_s.size):
        state = keep[n] * state + np.sqrt(1.0 - keep[n] ** 2) * draws[n] if n else state
        wander[n] = state
    return white + step * wander.sum(axis=-1)
