"""The devices of a lot: out = S(θ)·M·f + b(θ), and the ordinary noise of their dwells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.strangers.station import STEP_S, Day, Floats

ROOM_C = 25.0
# output unit, scale per g, density of white noise in g/√Hz, coefficients of temperature in g/K and 1/K
FAMILIES = (
    ("LSB", (1024.0, 4e5), (2e-5, 1.5e-4), 1.5e-4, 1e-4),
    ("V", (0.3, 2.0), (8e-6, 8e-5), 1e-4, 8e-5),
    ("V", (0.5, 4.0), (1e-6, 6e-6), 3e-5, 1e-4),
)


@dataclass(frozen=True)
class Devices:
    """u units of one family."""

    serials: tuple[str, ...]
    out_unit: str
    scale: Floats  # (u, 3), output per g
    matrix: Floats  # (u, 3, 3), rows are the axes of sensitivity
    bias: Floats  # (u, 3), g
    bias_temperature: Floats  # (u, 3), g/K
    scale_temperature: Floats  # (u, 3), 1/K
    sample_sd: Floats  # (u, 3), g
    flicker: Floats  # (u, 3), g rms
    walk: Floats  # (u, 3), g over 10 000 s
    rate_hz: float
    full_scale: float  # g
    thermometer_sd: float  # K

    def sensed(self, force: Floats) -> Floats:
        """M·f of (…, u, 3), g."""
        return np.einsum("uij,...uj->...ui", self.matrix, force)

    def ideal(self, force: Floats, temperature: Floats) -> Floats:
        """S(θ)·M·f + b(θ) in g (d, u, 3) from force (d, u, 3), g and temperature (d, u), °C."""
        warm = (temperature - ROOM_C)[..., None]
        return (1.0 + self.scale_temperature * warm) * self.sensed(force) + self.bias + self.bias_temperature * warm

    def white(self, duration_s: float) -> Floats:
        """Standard deviation (u, 3) of a dwell's mean from white noise alone, g."""
        return self.sample_sd / np.sqrt(max(round(duration_s * self.rate_hz), 1))


def draw_devices(rng: np.random.Generator, units: int, duration_s: float) -> Devices:
    """Devices of a family that the seed chooses; their slow noise is of the size of the white noise of a dwell."""
    unit, scales, densities, bias_heat, scale_heat = FAMILIES[int(rng.integers(len(FAMILIES)))]
    shape = (units, 3)
    rate = float(rng.choice([50.0, 100.0, 125.0, 200.0, 400.0]))
    density = np.exp(rng.uniform(*np.log(densities))) * rng.uniform(0.8, 1.25, 3) * rng.uniform(0.9, 1.1, shape)
    sample = density * np.sqrt(rate / 2.0)
    white = sample / np.sqrt(duration_s * rate)
    heat = rng.normal(0.0, bias_heat / 2.0, 3) + rng.normal(0.0, bias_heat / 3.0, shape)
    steepest = float(np.abs(heat).max())
    matrix = np.eye(3) + rng.uniform(-0.01, 0.01, (units, 3, 3)) * (1.0 - np.eye(3))
    first = int(rng.integers(100, 900))
    return Devices(
        serials=tuple(f"X{first + number:04d}" for number in range(units)),
        out_unit=unit,
        scale=np.exp(rng.uniform(*np.log(scales))) * (1.0 + rng.normal(0.0, 0.01, shape)),
        matrix=matrix * (1.0 + rng.normal(0.0, 1e-3, (units, 3, 1))),
        bias=rng.normal(0.0, 0.01, shape),
        bias_temperature=heat,
        scale_temperature=rng.normal(0.0, scale_heat, 3) + rng.normal(0.0, scale_heat / 4.0, shape),
        sample_sd=sample,
        flicker=white * rng.uniform(0.2, 1.2) * rng.uniform(0.9, 1.1, shape),
        walk=white * rng.uniform(0.0, 0.5),
        rate_hz=rate,
        full_scale=float(rng.choice([2.0, 4.0, 8.0, 16.0])),
        thermometer_sd=float(np.clip(0.1 * np.median(white) / steepest, 2e-4, 0.02)),
    )


def coloured(rng: np.random.Generator, count: int, exponent: float, shape: tuple[int, ...] = ()) -> Floats:
    """Noise (n, …) with a spectrum 1/f^exponent on the grid, by its Fourier coefficients; unit variance over twice its length."""
    length = int(2 ** np.ceil(np.log2(2 * count)))
    frequency = np.fft.rfftfreq(length, STEP_S)
    amplitude = np.zeros(frequency.size)
    amplitude[1:] = frequency[1:] ** (-exponent / 2.0)
    amplitude /= 2.0 * np.sqrt(np.sum(amplitude**2))
    lines = rng.standard_normal((*shape, frequency.size)) + 1j * rng.standard_normal((*shape, frequency.size))
    return np.moveaxis(np.fft.irfft(lines * amplitude, length, axis=-1)[..., :count], -1, 0) * length


def ordinary_noise(rng: np.random.Generator, day: Day, devices: Devices) -> Floats:
    """Noise (d, u, 3) of the means: white, 1/f and a small random walk, g."""
    shape = devices.scale.shape
    white = devices.white(day.plan.duration_s) * rng.standard_normal((len(day.angles), *shape))
    slow = day.mean(coloured(rng, day.t.size, 1.0, shape)) * devices.flicker
    steps = rng.standard_normal((day.t.size, *shape)) * np.sqrt(STEP_S / 1e4)
    return white + slow + day.mean(np.cumsum(steps, axis=0)) * devices.walk
