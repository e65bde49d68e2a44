"""The self-test of a station before a shift: instruments, moves, noise of the slots, and a check standard."""

import json
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from schemas.errors import StationError
from schemas.safety import SelfTest
from stations.station import Station

WILD = 0.05  # largest noise over full scale; a device at rest always has less
NOISIER = 3.0  # largest noise over the median of the slots, for at least this number of slots:
FEWEST_TO_COMPARE = 3
KEPT = 0.99  # smallest share of the samples expected between start and stop by the clock of the reader
STANDS = 0.5  # smallest elapsed over requested time; a clock that shows less has stopped, or is not that of the reader
RUNS_S = 10.0  # largest excess over the requested time; a clock that shows more is another, or has another [link] speed
SIGMAS = 3.0
MOVING_RANGE = 1.128  # mean range of two over sigma, normal: NIST/SEMATECH e-Handbook of Statistical Methods, 6.3.2.2
UP, DOWN = (0.0, 0.0), (180.0, 0.0)


@dataclass(frozen=True)
class CheckResult:
    """Result of one check: value, limits, whether it passed, and a message where it did not."""

    check: str
    part: str
    ok: bool
    value: float | str = ""
    unit: str = ""
    low: Annotated[float | None, "smallest value allowed"] = None
    high: Annotated[float | None, "largest value allowed"] = None
    message: Annotated[str, "empty if it is good"] = ""


@dataclass(frozen=True)
class Standard:
    """One measurement of the check standard; ``offset`` in the unit of the output, ``scale`` in that unit per g."""

    serial: str
    offset: float
    scale: float
    unit_C: float
    when: str = ""


@dataclass
class SelfTestBench:
    """The self-test of one station; it collects the results, and continues with the other parts after a failure."""

    station: Station
    rules: SelfTest
    history: list[Standard] = field(default_factory=list[Standard])
    findings: list[CheckResult] = field(default_factory=list[CheckResult])
    standard: Standard | None = None
    elapsed: float = 0.0

    def run(self) -> list[CheckResult]:
        """Runs the checks; the results in their order."""
        self._run_check("instruments", "reader", self._instruments)
        if all(finding.ok for finding in self.findings if finding.check in {"door", "emergency stop"}):
            for check, part, test in (
                ("chamber", "chamber", self._chamber),
                ("move", "table", self._moves),
                ("noise", "slots", self._noise),
                ("check standard", "slots", self._standard),
            ):
                self._run_check(check, part, test)
        return self.findings

    def _run_check(self, check: str, part: str, test: Callable[[], None]) -> None:
        try:
            test()
        except StationError as problem:
            self.findings.append(CheckResult(check, part, ok=False, message=str(problem)))

    def _value(self, check: str, part: str, value: float, unit: str, bounds: tuple[float, float]) -> None:
        low, high = bounds
        ok = low <= value <= high
        measure = f" {unit}" if unit else ""
        needed = f"{low:.6g} to {high:.6g}" if math.isfinite(high) else f"at least {low:.6g}"
        text = "" if ok else f"{part}: {check} {value:.6g}{measure}, {needed}{measure} is needed"
        self.findings.append(CheckResult(check, part, ok, value, unit, _finite(low), _finite(high), text))

    def _state(self, check: str, part: str, state: str, needed: str) -> None:
        ok = state == needed
        text = "" if ok else f"{part}: {check} is {state}, {needed} is needed"
        self.findings.append(CheckResult(check, part, ok, state, message=text))

    def _instruments(self) -> None:
        now, limits = self.station.reader.instruments(), self.station.config.suspenders
        self._state("door", "reader", "open" if now.door_open else "closed", "closed")
        self._state("emergency stop", "reader", "pressed" if now.stop_pressed else "released", "released")
        self._value("vibration", "reader", now.vibration_g, "g rms", (0.0, limits.vibration_g))
        for slot in sorted(self.station.reader.slots):
            self._value("temperature", f"slot {slot}", now.temperature_C[slot], "°C", (-100.0, 250.0))
            self._value("supply", f"slot {slot}", now.supply_V[slot], "V", limits.supply_V or (0.5, 60.0))

    def _chamber(self) -> None:
        chamber = self.station.chamber
        self._value("air", "chamber", chamber.temperature(), "°C", (-100.0, 250.0))
        self._state("mode", "chamber", chamber.mode(), chamber.running)

    def _moves(self) -> None:
        """Moves to the test pose and back, each confirmed by the encoders."""
        allowed = self.station.config.limits.position_deg
        for outer, inner in ((self.rules.outer_deg, self.rules.inner_deg), UP):
            self.station.table.move(outer, inner)
            angles = self.station.table.angles()
            for name, target, angle in (("outer axis", outer, angles[0]), ("inner axis", inner, angles[1])):
                self._value(f"move to {target:g}°", name, angle - target, "deg", (-allowed, allowed))

    def _noise(self) -> None:
        """Noise at rest: standard deviation of the noisiest axis, missing samples, axes with a constant output."""
        self.station.table.move(*UP)
        deviations: dict[int, NDArray[np.float64]] = {}
        samples_of = self._sampled()
        latest = self.rules.sample_s + RUNS_S * max(1.0, self.station.config.link.speed)
        self._value("clock", "reader", self.elapsed, "s", (STANDS * self.rules.sample_s, latest))
        if self.elapsed > latest:
            served = (
                "a station that 'tumbleline station serve --speed' serves needs the same speed in [link] of its file"
            )
            self.findings[-1] = replace(self.findings[-1], message=f"{self.findings[-1].message}; {served}")
        for slot, samples in samples_of.items():
            expected = math.floor(KEPT * self.elapsed * self.rules.rate_hz) - 1.0
            self._value("samples", f"slot {slot}", float(len(samples)), "", (max(expected, 0.0), math.inf))
            if len(samples) > 1:
                deviations[slot] = np.std(samples, axis=0, ddof=1)
        shaking = self.station.reader.instruments().vibration_g
        allowed = (0.0, self.station.config.suspenders.vibration_g)
        self._value("vibration at rest", "reader", shaking, "g rms", allowed)
        usual = float(np.median([deviation.max() for deviation in deviations.values()])) if deviations else 0.0
        for slot, deviation in deviations.items():
            self._check_noise(slot, deviation, usual if len(deviations) >= FEWEST_TO_COMPARE else math.inf)

    def _check_noise(self, slot: int, deviation: NDArray[np.float64], usual: float) -> None:
        """Compares the noise of one slot, (3,), with its limit, or with the median of the slots."""
        part, identity = f"slot {slot}", self.station.reader.slots[slot].identity()
        if deviation.min() == 0.0:
            axis = "xyz"[int(np.argmin(deviation))]
            text = f"{part}: the output on {axis} is constant, a changing output is needed; check wiring and power"
            self.findings.append(CheckResult("noise", part, ok=False, value=0.0, unit=identity.out_unit, message=text))
            return
        most = self.rules.noise_max or min(NOISIER * usual, WILD * identity.full_scale)
        self._value("noise", part, float(deviation.max()), identity.out_unit, (0.0, most))

    def _standard(self) -> None:
        """Compares offset and scale of the check standard on z, from two poses, with their control limits."""
        if not self.rules.standard:
            return
        slots = self.station.reader.slots
        numbers = [number for number, slot in slots.items() if slot.identity().serial == self.rules.standard]
        if not numbers:
            text = f"slots: check standard {self.rules.standard} is in no slot; insert it, or correct [self_test]"
            self.findings.append(CheckResult("check standard", "slots", ok=False, message=text))
            return
        means: list[float] = []
        for pose in (UP, DOWN):
            self.station.table.move(*pose)
            means.append(float(self._sampled()[numbers[0]][:, 2].mean()))
        unit = slots[numbers[0]].identity().out_unit
        temperature = self.station.reader.instruments().temperature_C[numbers[0]]
        when, serial = datetime.now(UTC).isoformat(timespec="seconds"), self.rules.standard
        offset, scale = (means[0] + means[1]) / 2.0, (means[0] - means[1]) / 2.0
        self.standard = Standard(serial, offset, scale, temperature, when)
        past, fewest = [s for s in self.history if s.serial == serial], self.rules.history_min
        for check, value, of, given, earlier in (
            ("offset", offset, unit, self.rules.offset, [s.offset for s in past]),
            ("scale", scale, f"{unit}/g", self.rules.scale, [s.scale for s in past]),
        ):
            bounds = given or control_limits(earlier, fewest) or (-math.inf, math.inf)
            self._value(check, f"standard {serial}", value, of, bounds)

    def _sampled(self) -> dict[int, NDArray[np.float64]]:
        """Samples by slot, (n, 3) in the unit of each output, at the present pose.

        The clock of the reader is read after the start and before the stop, which may be slow on a busy link.
        """
        reader, clock = self.station.reader, self.station.clock
        clock.sleep(self.rules.settle_s)
        reader.start(self.rules.rate_hz)
        begun = reader.since_power()
        clock.sleep(self.rules.sample_s)
        ended = reader.since_power()
        reader.stop()
        # the register has single precision
        self.elapsed = ended - begun - 2.0 * float(np.spacing(np.float32(abs(ended))))
        return {number: slot.take().outputs for number, slot in sorted(reader.slots.items())}


def control_limits(past: Sequence[float], fewest: int) -> tuple[float, float] | None:
    """Limits of an individuals chart, mean ± 3 sigma with sigma from the moving range; None before ``fewest`` values.

    NIST/SEMATECH e-Handbook of Statistical Methods, 6.3.2.2.
    """
    if len(past) < fewest:
        return None
    values = np.array(past, dtype=np.float64)
    sigma = float(np.abs(np.diff(values)).mean()) / MOVING_RANGE
    centre = float(values.mean())
    return centre - SIGMAS * sigma, centre + SIGMAS * sigma


def read_history(path: Path) -> list[Standard]:
    """Earlier measurements of check standards, oldest first; an incomplete line is skipped."""
    measurements: list[Standard] = []
    for line in path.read_text("utf-8").splitlines() if path.is_file() else []:
        with suppress(ValueError, TypeError):
            measurements.append(Standard(**json.loads(line)))
    return measurements


def keep(path: Path, standard: Standard) -> None:
    """Appends a measurement within its limits to the history."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(asdict(standard)) + "\n")


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
