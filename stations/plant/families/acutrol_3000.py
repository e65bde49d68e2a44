"""The simulated centrifuge behind an ACUTROL 3000: mountings at several radii, arm stretch, proof masses, a recorder."""

import math
from collections.abc import Callable

import numpy as np

from schemas.profile import Profile
from schemas.units import AXES, STANDARD_GRAVITY_M_S2
from stations.codec import OUTPUTS
from stations.plant.bench import Bench, Waveforms
from stations.plant.device import stream
from stations.plant.equipment import UNKNOWN, WRONG, ResultFiles
from stations.plant.world import World

RADIUS_M = 0.5  # of the usual mounting
HOLE_M = 20e-6  # standard deviation of a mounting's radius about its nominal one
STANDING_DEG_S = 0.01
ACCELERATION_DEG_S2 = 100.0
RECORD_HZ = 200.0
SENSOR_M = 0.4  # radius of the reference sensor on the arm
SENSOR_NOISE = 2e-5  # of its acceleration, one sample
IDLE_S = 900.0  # without a line for so long the machine stops by itself


def radius_error(bench: Bench, radius_m: float) -> float:
    """Radius of a mounting on the arm minus its nominal one, m; all runs of a station share it."""
    if math.isclose(radius_m, RADIUS_M, abs_tol=1e-6):
        return bench.rig.arm_radius_error_m
    return HOLE_M * float(stream(bench.station_seed, "bench", "radius", round(1e6 * radius_m)).standard_normal())


class Centrifuge:
    """Follows the demanded rate at constant acceleration; an open interlock or a long silence brings it to rest.

    Units are mounted (direction, radius) at rest only, with the interlock open; radial is their z, or x of a device without z.
    """

    def __init__(self, world: World, profile: Profile) -> None:
        self._world = world
        self._from, self._to, self._since_us = 0.0, 0.0, 0
        self._closed, self._direction, self._asked = False, 1.0, 0.0
        self._radius = RADIUS_M
        self._heard_us, self._tripped = 0, ""
        self._number, self._seconds, self._start_us = 0, 0.0, 0
        self._files = ResultFiles()

    def answer(self, line: str) -> tuple[str, bool]:
        self._watch()
        head, _, value = line.partition(",")
        reports: dict[str, Callable[[], str]] = {
            ":read:rate? 1": lambda: f"{self.rate():.6f}",
            ":mount? 1": lambda: f"{self._direction:.0f}",
            ":radius? 1": lambda: f"{self._radius:.6f}",
            ":interlock? 1": lambda: (
                f"Fault {self._tripped}" if self._tripped else "Closed" if self._closed else "Open"
            ),
            ":rec:file?": self._file,
            ":mode? 1": lambda: "rate",
            ":int? 1": lambda: "close" if self._closed else "open",
        }
        if line in reports:
            return reports[line](), False
        self._heard_us = self._world.now_us
        if line in {":int:close 1", ":int:open 1", ":mode:off 1", ":mode:rate 1"}:
            if line.startswith(":int:"):
                self._closed = line.endswith("close 1")
            if line == ":int:open 1":
                self._go(0.0)
            return "OK", True
        try:
            number = float(value)
        except ValueError:
            return UNKNOWN, False
        if head == ":dem:rate 1":
            self._asked = number
            self._go(number if self._closed and not self._tripped else 0.0)
        elif head in {":mount 1", ":radius 1"}:
            return self._mount(head, number)
        elif head == ":rec 1":
            if "missed_trigger" not in self._world.bench.conditions:
                self._number += 1
                self._seconds, self._start_us = number, self._world.now_us
        else:
            return UNKNOWN, False
        return "OK", True

    def _mount(self, head: str, number: float) -> tuple[str, bool]:
        """Units mounted the other way round or at another radius."""
        if self._closed or abs(self.rate()) > STANDING_DEG_S:
            return WRONG, False
        if head == ":mount 1":
            self._direction = 1.0 if number > 0.0 else -1.0
        else:
            self._radius = number
        return "OK", True

    def rate(self) -> float:
        """Rate now, °/s."""
        way = ACCELERATION_DEG_S2 * 1e-6 * (self._world.now_us - self._since_us)
        return self._from + math.copysign(min(way, abs(self._to - self._from)), self._to - self._from)

    def _go(self, rate_deg_s: float) -> None:
        self._from, self._to, self._since_us = self.rate(), rate_deg_s, self._world.now_us

    def _watch(self) -> None:
        """Trips by door and overspeed, and the stop after a silence; all follow from the plant's time."""
        conditions = self._world.bench.conditions
        cause = "guard door" if "guard_door" in conditions else "overspeed" if "overspeed" in conditions else ""
        if cause and not self._tripped:
            self._tripped = cause
            self._go(0.0)
        elif not cause:
            self._tripped = ""
        if "drive_runaway" in conditions and self._to > 0.0 and self._to == self._asked:
            self._go(1.5 * self._asked)
        if self._to > 0.0 and self._world.now_us - self._heard_us > round(1e6 * IDLE_S):
            self._go(0.0)

    def _file(self) -> str:
        over = self._world.now_us >= self._start_us + round(1e6 * self._seconds)
        return self._files.write(self._number, self._recorded, self._world.slots) if self._number and over else "NONE"

    def _recorded(self) -> Waveforms:
        bench = self._world.bench
        rig, omega = bench.rig, math.radians(self._to)
        arm = (self._radius + radius_error(bench, self._radius)) * (1.0 + rig.arm_stretch * omega**2)
        offsets = np.array([unit.mass_offset_m for unit in bench.units])
        force = self._direction * (arm + self._direction * offsets) * omega**2 / STANDARD_GRAVITY_M_S2
        wobble = bench.stream_at(self._start_us, 10).standard_normal()
        force = force * (1.0 + 2e-6 * float(wobble))
        radial = 2 if OUTPUTS[self._world.preset.packing] == len(AXES) else 0  # a device without z is mounted by its x
        outputs = bench.steady(force, radial, self._seconds, RECORD_HZ, self._start_us)
        rng = bench.stream_at(self._start_us, 9)
        reference = np.zeros((round(self._seconds * 10.0), 3))
        reference[:, 0] = self._to * (1.0 + 1e-6 * rng.standard_normal(len(reference)))
        felt = (SENSOR_M + radius_error(bench, SENSOR_M)) * (1.0 + rig.arm_stretch * omega**2) * omega**2
        read = felt / STANDARD_GRAVITY_M_S2 * (1.0 + rig.reference_error) * (1.0 + 2e-6 * float(wobble))
        reference[:, 1] = read * (1.0 + SENSOR_NOISE * rng.standard_normal(len(reference)))
        return Waveforms(outputs, RECORD_HZ, reference, 10.0)


simulated = Centrifuge
