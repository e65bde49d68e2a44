"""Common parts of the simulated controllers: registers and set points of chambers, moves, errors of SCPI, result files."""

import math
import shutil
import tempfile
import weakref
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scipy.io import savemat

from schemas.profile import Profile
from schemas.units import STANDARD_GRAVITY_M_S2
from stations.codec import Value
from stations.plant.bank import Bank, Busy, Sink, Source, number
from stations.plant.bench import Waveforms
from stations.plant.fixture import Chamber
from stations.plant.table import Axis
from stations.plant.world import World

DEFAULT_LIMITS_C = (-100.0, 250.0)  # for profiles without limits
HUMIDITY_PCT = 40.0
ABSOLUTE = 1  # type of a move
STROKE_M, VELOCITY_M_S, ACCELERATION_G = 0.0127, 1.5, 50.0  # of the exciter


def controller_bank(world: World, profile: Profile, own: Mapping[str, Source], command: Sink) -> Bank:
    """A bank with the registers ``own`` and then the common registers of a chamber controller; ``command`` handles writes."""
    chamber = world.fixture.chamber
    point = profile.register("set_point")
    sources: dict[str, Source] = {
        "temperature": world.air_reading,
        "set_point": lambda: chamber.set_point,
        "working_set_point": lambda: chamber.working,
        "set_point_low": lambda: DEFAULT_LIMITS_C[0] if point.minimum is None else point.minimum,
        "set_point_high": lambda: DEFAULT_LIMITS_C[1] if point.maximum is None else point.maximum,
        "temperature_unit": lambda: "celsius",
        "power": lambda: 100.0 * chamber.power,
        "ramp_rate": lambda: chamber.ramp_K_min,
        "humidity": lambda: HUMIDITY_PCT,
        "humidity_set_point": lambda: HUMIDITY_PCT,
        **own,
    }
    return Bank(profile, sources, command)


def set_by(chamber: Chamber, name: str) -> Callable[[dict[str, Value]], None]:
    """The effect of a write to the register of the set point."""

    def command(values: dict[str, Value]) -> None:
        if name in values:
            chamber.set_point = number(values, name)

    return command


def exciter_reach(frequency: float) -> float:
    """Largest peak acceleration of the exciter at a frequency in Hz, g."""
    w = 2.0 * math.pi * frequency
    return min(STROKE_M * w**2 / STANDARD_GRAVITY_M_S2, VELOCITY_M_S * w / STANDARD_GRAVITY_M_S2, ACCELERATION_G)


def start_move(world: World, axis: Axis, profile: Profile, values: dict[str, Value]) -> None:
    """Starts a move of a drive at rest."""
    if axis.moving(world.now):
        raise Busy(profile.name)
    axis.go(world.now, number(values, "target"), number(values, "speed"), number(values, "acceleration"))


DONE = "1"
OUT_OF_RANGE, UNDEFINED = -222, -113  # SCPI-99, 21.8.10 and 21.8.9
TEXTS = {0: "No error", OUT_OF_RANGE: "Data out of range", UNDEFINED: "Undefined header"}


class ScpiDevice:
    """A device whose orders are done at once; an error is told when it is asked for, and forgotten."""

    def __init__(self) -> None:
        self.error = 0

    def told_error(self) -> tuple[str, bool]:
        """The answer to the question for errors, and whether it changed anything."""
        code, self.error = self.error, 0
        return f'{code},"{TEXTS[code]}"', code != 0

    def ordered(self, value: str, low: float, high: float) -> float | None:
        """The number of an order; None, with an error, for what is no number or outside its range."""
        try:
            number = float(value)
        except ValueError:
            self.error = UNDEFINED
            return None
        if not low <= number <= high:
            self.error = OUT_OF_RANGE
            return None
        return number


class ResultFiles:
    """Writes one file a recording; only the last is kept."""

    def __init__(self) -> None:
        self._folder: Path | None = None
        self._last: Path | None = None

    def write(
        self, number: int, recorded: Callable[[], Waveforms], slots: Sequence[int], reference_unit: str = "g"
    ) -> str:
        """The path of the file of a recording, which is computed once."""
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="tumbleline-results-"))
            weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        path = self._folder / f"test{number:06d}.mat"
        if path == self._last:
            return str(path)
        made = recorded()
        content: dict[str, Any] = {
            "rate_hz": made.rate_hz,
            "reference": made.reference,
            "reference_rate_hz": made.reference_rate_hz,
            "reference_unit": reference_unit,
            **{f"slot_{slot}": made.outputs[:, k] for k, slot in enumerate(slots)},
        }
        savemat(path, content)
        if self._last is not None:
            self._last.unlink(missing_ok=True)
        self._last = path
        return str(path)
