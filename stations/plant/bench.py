"""Physics of the test equipment of a simulated station: units and reference on exciter, shock machine and centrifuge.

It is written independently of the models that are fitted: a response is the product of a sprung mass, the low-pass of the output
stage and a delay, with a nonlinear spring between, sampled by a clock of the device's own.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from stations.plant.device import PlantDevices, Truth, stream
from stations.plant.dynamics import DynamicTruth, Rig, directions, two_pole_behind
from stations.plant.hidden import HiddenEffect
from stations.plant.preset import Preset

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

DIGITAL_HZ = 8000.0
ANALOGUE_HZ = 51200.0
FINE_HZ = 102400.0
PERIOD_POINTS = 64
PER_CYCLE, SLOWEST_HZ = 40.0, 1600.0  # samples of a cycle, and the slowest rate, of the recorder in a sine test
STEP_FINE_HZ = 409600.0
DRIVE_RISE_S = 2e-6  # time constant of the generator at the self-test inputs
SELF_TEST_G_V, SELF_TEST_SPREAD = 0.5, 0.1  # force of the self-test, and its standard deviation over units and axes


@dataclass
class Waveforms:
    """Outputs of the units (n, units, 3) in the output's unit, the reference (m, 3) in g, and their rates."""

    outputs: Array
    rate_hz: float
    reference: Array
    reference_rate_hz: float


@dataclass
class Bench:
    """Units of a lot on the station's test equipment."""

    preset: Preset
    truths: Sequence[Truth]
    devices: PlantDevices
    gravity: float
    station_seed: int
    lot_seed: int
    key: int
    hidden: Sequence[HiddenEffect] = ()
    around: Callable[[], tuple[Array, float]] | None = (
        None  # temperature of the units (s,), °C, and pressure of the air, hPa
    )
    conditions: set[str] = field(default_factory=set[str])
    cable_off: set[int] = field(default_factory=set[int])
    broken: dict[int, str] = field(default_factory=dict[int, str])

    def __post_init__(self) -> None:
        """Draws what the units and the equipment are."""
        self.units = [self._unit(truth.serial) for truth in self.truths]
        forces = [stream(self.lot_seed, truth.serial, "self-test").standard_normal(3) for truth in self.truths]
        self.self_test_g_V = SELF_TEST_G_V * (1.0 + SELF_TEST_SPREAD * np.stack(forces))
        z = stream(self.station_seed, "bench").standard_normal(8)
        u = stream(self.station_seed, "bench", "uniform").uniform(size=8)
        self.rig = Rig(
            reference_error=0.0025 * float(z[0]),
            distortion=0.01 + 0.02 * float(u[0]),
            transverse=0.03 + 0.04 * float(u[1]),
            transverse_angle=2.0 * math.pi * float(u[2]),
            fixture_hz=2500.0 + 1500.0 * float(u[3]),
            fixture_damping=0.02,
            arm_radius_error_m=20e-6 * float(z[1]),
            arm_stretch=2e-9 * (1.0 + float(u[4])),
        )

    def _unit(self, serial: str) -> DynamicTruth:
        preset = self.preset
        z = stream(self.lot_seed, serial, "dynamics").standard_normal(8)
        u = stream(self.lot_seed, serial, "dynamics", "uniform").uniform(-1.0, 1.0, 4)
        digital = preset.output_unit == "LSB"
        return DynamicTruth(
            natural_hz=preset.natural_frequency_hz * (1.0 + 0.01 * float(z[0])),
            damping=preset.damping * (1.0 + 0.03 * float(z[1])),
            low_pass_hz=two_pole_behind(preset) * (1.0 + 0.01 * float(z[2])),
            delay_s=(40e-6 + 20e-6 * float(u[0])) if digital else (3e-6 + 2e-6 * float(u[0])),
            clock=0.01 * float(u[1]) if digital else 20e-6 * float(u[1]),
            quadratic=0.1 * 1e-2 * preset.linearity_pct_fs / preset.range_g * z[3:6],
            mass_offset_m=1e-4 * float(z[6]),
        )

    def units_now(self) -> list[DynamicTruth]:
        """The units in the air that there is: what it does to spring and damping is in no register."""
        if self.around is None or not self.hidden:
            return self.units
        natural, damping = np.ones(len(self.units)), np.ones(len(self.units))
        for effect in self.hidden:
            of_spring, of_damping = effect.sprung(*self.around())
            natural, damping = natural * of_spring, damping * of_damping
        return [
            replace(unit, natural_hz=unit.natural_hz * float(n), damping=unit.damping * float(d))
            for unit, n, d in zip(self.units, natural, damping, strict=True)
        ]

    @property
    def rate_hz(self) -> float:
        """Nominal rate at which the outputs are recorded, Hz."""
        return DIGITAL_HZ if self.preset.output_unit == "LSB" else ANALOGUE_HZ

    def sine(
        self,
        frequency: float,
        level: float,
        axis: int,
        seconds: float,
        tick: int,
        conditions: frozenset[str] = frozenset(),
        across_deg: float | None = None,
    ) -> Waveforms:
        """Steady vibration along an axis, which points up: the record of ``seconds`` from a common trigger.

        With ``across_deg`` the axis still points up and the exciter moves across it, at this angle from the next axis.
        """
        rng, rig = self.stream_at(tick, 1), self.rig
        a = level * (1.0 + 0.02 * rng.standard_normal())
        if "level_not_reached" in conditions:
            a *= 0.3
        phase = 2.0 * math.pi * rng.uniform()
        share, skew = rig.repeatability * rng.standard_normal(), rig.repeatability * rng.standard_normal()
        turn = 2.0 * math.pi * np.arange(PERIOD_POINTS) / PERIOD_POINTS + phase
        along = (
            a * np.cos(turn)
            + a * rig.distortion * np.cos(2.0 * turn + 0.7)
            + 0.4 * a * rig.distortion * np.cos(3.0 * turn)
        )
        r = frequency / rig.fixture_hz
        fixture = abs(1.0 + r**2 / (1.0 - r**2 + 2j * rig.fixture_damping * r))
        cross = a * rig.transverse * min(fixture, 1.0 / rig.transverse) * np.cos(turn + 1.0)
        driven, beside, third = directions(axis, across_deg)
        base = np.outer(along, driven)
        base += np.outer(cross * math.cos(rig.transverse_angle), beside)
        base += np.outer(cross * math.sin(rig.transverse_angle), third)
        recorder = ANALOGUE_HZ
        while recorder / 2.0 >= max(PER_CYCLE * frequency, SLOWEST_HZ):
            recorder /= 2.0
        rate = min(self.rate_hz, recorder) if self.preset.output_unit == "V" else self.rate_hz
        n_ref = round(seconds * recorder)
        reference = self._harmonics(np.fft.rfft(base, axis=0), frequency, np.arange(n_ref) / recorder)
        reference = self._as_reference(reference, rng, conditions)
        felt = base + np.outer(share * along, driven)
        felt[:, axis] += self.gravity
        spectrum = np.fft.rfft(felt, axis=0)
        orders = frequency * np.arange(len(spectrum), dtype=np.float64)
        outputs = np.zeros((round(seconds * rate), len(self.units), 3))
        for k, (unit, truth) in enumerate(zip(self.units_now(), self.truths, strict=True)):
            moved = np.fft.irfft(spectrum * unit.mass(orders)[:, None], PERIOD_POINTS, axis=0)
            bent = self._bent(truth, unit, moved)
            late = np.exp(-2j * np.pi * orders * (unit.delay_s + skew / (2.0 * np.pi * max(frequency, 1.0))))
            after = np.fft.rfft(bent, axis=0) * (unit.behind(orders) * late)[:, None]
            time = np.arange(len(outputs)) / (rate * (1.0 + unit.clock))
            outputs[:, k] = self._harmonics(after, frequency, time)
            if self.preset.output_unit == "V":
                outputs[:, k] += rig.hum_g * np.cos(2.0 * np.pi * 50.0 * time + 1.0)[:, None]
        return Waveforms(self._converted(outputs, rng, rate), rate, reference, recorder)

    def transient(
        self,
        force: Array,
        axis: int,
        tick: int,
        fine_hz: float = FINE_HZ,
        slow_hz: float = 0.0,
        conditions: frozenset[str] = frozenset(),
    ) -> Waveforms:
        """Response to a force (n,) in g along an axis at a fine rate, which begins and ends at rest.

        fine_hz : of the force
        slow_hz : rate of the recorder for a long recording; its usual one where 0
        """
        rng = self.stream_at(tick, 2)
        n = len(force)
        along = np.zeros((n, 3))
        along[:, axis] = force
        rest = np.zeros(3)
        rest[axis] = self.gravity
        rate = min(self.rate_hz, slow_hz or self.rate_hz)
        outputs = self._answers(along, np.ones((len(self.units), 3)), rest, fine_hz, rate)
        reference = np.zeros((n, 3))
        reference[:, axis] = force
        recorder = slow_hz or ANALOGUE_HZ
        reference = self._as_reference(reference[:: round(fine_hz / recorder)], rng, conditions)
        return Waveforms(self._converted(outputs, rng, rate), rate, reference, recorder)

    def _answers(self, force: Array, share: Array, rest: Array, fine_hz: float, rate_hz: float) -> Array:
        """Outputs (n, units, 3) in g of forces (m, 3) in g at a fine rate, times ``share`` (units, 3), beside ``rest``."""
        n = len(force)
        length: int = cast("Any", next_fast_len)(n + round(0.05 * fine_hz), real=True)
        f = np.asarray(np.fft.rfftfreq(length, 1.0 / fine_hz), dtype=np.float64)
        padded = np.zeros((length, 3))
        padded[:n] = force
        count = int(n / fine_hz * rate_hz * 0.985)
        outputs = np.zeros((count, len(self.units), 3))
        spectrum = np.fft.rfft(padded, axis=0)
        fine = np.arange(n) / fine_hz
        for k, (unit, truth) in enumerate(zip(self.units_now(), self.truths, strict=True)):
            moved = np.fft.irfft(spectrum * unit.mass(f)[:, None] * share[k], length, axis=0) + rest
            bent = self._bent(truth, unit, moved)
            floor = bent[-1]
            late = unit.behind(f) * np.exp(-2j * np.pi * f * unit.delay_s)
            after = np.fft.irfft(np.fft.rfft(bent - floor, axis=0) * late[:, None], length, axis=0)[:n] + floor
            time = np.arange(count) / (rate_hz * (1.0 + unit.clock))
            outputs[:, k] = np.stack([np.interp(time, fine, after[:, i]) for i in range(3)], axis=1)
        return outputs

    def self_test(
        self,
        volts: float,
        hold_s: float,
        before_s: float,
        seconds: float,
        tick: int,
        conditions: frozenset[str] = frozenset(),
    ) -> Waveforms:
        """Response to a step of voltage at the self-test inputs, which push all masses; the reference is the drive in V."""
        rng, fine_hz = self.stream_at(tick, 4), STEP_FINE_HZ
        volts *= 0.3 if "level_not_reached" in conditions else 1.0
        n = round(seconds * fine_hz)
        time = np.arange(n) / fine_hz - before_s - rng.uniform(0.0, 1.0) / ANALOGUE_HZ
        drive = np.where(time >= 0.0, -np.expm1(-np.maximum(time, 0.0) / DRIVE_RISE_S), 0.0)
        drive = volts * np.where(time >= hold_s, np.exp(-np.maximum(time - hold_s, 0.0) / DRIVE_RISE_S), drive)
        rest = np.zeros(3)
        rest[2] = self.gravity
        force = drive[:, None] * np.ones(3)
        rate = self.rate_hz
        outputs = self._answers(force, self.self_test_g_V, rest, fine_hz, rate)
        recorded = drive[:: round(fine_hz / ANALOGUE_HZ), None] * np.array([1.0, 0.0, 0.0])
        recorded = recorded + 2e-4 * rng.standard_normal(recorded.shape)
        return Waveforms(self._converted(outputs, rng, rate), rate, recorded, ANALOGUE_HZ)

    def steady(self, force: Array, axis: int, seconds: float, rate_hz: float, tick: int) -> Array:
        """Outputs (n, units, 3) under steady forces (units,) in g along an axis."""
        rng = self.stream_at(tick, 3)
        count = round(seconds * rate_hz)
        outputs = np.zeros((count, len(self.units), 3))
        for k, (unit, truth) in enumerate(zip(self.units_now(), self.truths, strict=True)):
            felt = np.zeros((1, 3))
            felt[0, axis] = force[k]
            outputs[:, k] = self._bent(truth, unit, felt)
        return self._converted(outputs, rng, rate_hz)

    def hit(self, peak_g: float) -> None:
        """A shock: beyond the sheet's limit a unit changes for good, by a step of its bias; far beyond it its output dies."""
        limit = self.preset.shock_limit_g
        for k in range(len(self.units)):
            if peak_g > 2.0 * limit:
                self.broken[k] = "dead"
            elif peak_g > limit:
                self.devices.shift_bias(k, 5e-3 * self.preset.range_g)

    def _bent(self, truth: Truth, unit: DynamicTruth, force: Array) -> Array:
        """Output in g of a force (n, 3) in g at 25 °C: misalignment, springs that are not linear, scale and bias."""
        along = force @ truth.misalignment.T
        along = along + unit.quadratic * force**2 + truth.cubic * force**3
        return self.devices.bias_of(truth.serial, self.truths) + (1.0 + 1e-6 * truth.scale_ppm) * along

    def _converted(self, outputs: Array, rng: np.random.Generator, rate_hz: float = 0.0) -> Array:
        """Noise, clipping and rounding of outputs (n, units, 3) in g; result in the output's unit."""
        preset = self.preset
        sigma = 1e-6 * preset.sample_noise_ug(rate_hz or self.rate_hz)
        noisy = outputs + sigma * rng.standard_normal(outputs.shape)
        for k in self.cable_off:
            noisy[:, k] = sigma * rng.standard_normal((len(outputs), 3))
        for k in self.broken:
            noisy[:, k] = 0.0
        inside = np.clip(noisy, -preset.range_g, preset.range_g)
        counts = np.rint((preset.zero_level + preset.scale * inside) / preset.lsb)
        return np.clip(counts, -preset.largest_count - 1, preset.largest_count) * preset.lsb

    def _as_reference(self, reference: Array, rng: np.random.Generator, conditions: frozenset[str]) -> Array:
        """Readings of the reference sensor of (n, 3) g: its error of calibration, noise, and a range that may clip."""
        felt = 0.0 * reference if "reference_cable_off" in conditions else reference
        read = felt * (1.0 + self.rig.reference_error) + 2e-4 * rng.standard_normal(reference.shape)
        if "clipped_reference" in conditions:
            top = 0.6 * float(np.max(np.abs(read)))
            read = np.clip(read, -top, top)
        return read

    @staticmethod
    def _harmonics(spectrum: Complex, frequency: float, time: Array) -> Array:
        """A periodic signal (n, channels) at any instants, from its spectrum over a period."""
        out = np.real(spectrum[0])[None, :] / PERIOD_POINTS + np.zeros((len(time), spectrum.shape[1]))
        first = np.exp(2j * np.pi * frequency * time)
        spin = np.ones_like(first)
        for k in range(1, 6):
            spin = spin * first
            out = out + 2.0 / PERIOD_POINTS * np.real(spin[:, None] * spectrum[k])
        return out

    def stream_at(self, tick: int, channel: int) -> np.random.Generator:
        """Random numbers of a record that begins at a time in µs; other stations and lots have others."""
        return np.random.Generator(np.random.Philox(key=self.key, counter=[0, 7, channel, tick]))
