"""Devices under test: what is true of each unit, and how force becomes counts."""

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stations.plant.preset import Preset

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

REFERENCE_C = 25.0
SUPPLY_SHIFT_G = 0.05  # bias of a device that is not ratiometric, for a supply that is gone
RATIOMETRIC_ERROR = 3e-3  # one sigma: departure of a ratiometric gain, per relative change of the supply
REGULATOR_HZ, HIGHEST_HZ = (
    200.0,
    20e3,
)  # from which and to which the regulator of a device rejects less and less of a ripple
REJECTION = 1e-3  # one sigma: relative change of the gain of other outputs, per relative change of the supply
QUADRATIC_PER_K = 0.003  # quadratic over linear temperature coefficient, one sigma


@dataclass(frozen=True)
class Truth:
    """True parameters of a unit, in its frame; ``slot_rotation`` is the fixture's part.

    Output in g = bias(θ) + scale(θ)·(misalignment·f + cubic·f³) + noise, θ = T − 25 °C; times ``output_scale`` it is in
    the output's unit.
    """

    serial: str
    bias_g: Array  # (3,)
    scale_ppm: Array  # (3,), deviation from nominal
    misalignment: Array  # (3, 3), ones on the diagonal
    bias_tempco: Array  # (3,), g/K
    bias_tempco_quadratic: Array  # (3,), g/K²
    scale_tempco: Array  # (3,), 1/K
    scale_tempco_quadratic: Array  # (3,), 1/K²
    cubic: Array  # (3,), 1/g²
    slot_rotation: Array  # (3, 3), fixture to slot
    output_scale: float  # output units per g
    zero_level: float  # output units
    supply_ratio: float  # output over that at the nominal supply: the share of the supply's offset that it follows
    supply_gain: float = 0.0  # relative change of the gain besides, per relative change of the supply

    @property
    def matrix(self) -> Array:
        """Output in g over force in the fixture at 25 °C, (3, 3): scale, misalignment and slot together."""
        return (1.0 + 1e-6 * self.scale_ppm)[:, None] * (self.misalignment @ self.slot_rotation)


def stream(*key: int | str) -> np.random.Generator:
    """A generator that belongs to a key of whole numbers and texts."""
    words = [zlib.crc32(k.encode()) if isinstance(k, str) else k for k in key]
    return np.random.default_rng(np.random.SeedSequence(words))


def draw_truth(
    preset: Preset, serial: str, seed: int, *, slot_rotation: Array, supply_ratio: float, output_scale: float
) -> Truth:
    """A unit's truth, determined by serial and seed alone, whatever the station."""
    rng = stream(seed, serial, "truth")
    normal = rng.standard_normal((8, 3))
    skew = np.eye(3) + 1e-3 * preset.misalignment_sd_mrad * rng.standard_normal((3, 3)) * (1.0 - np.eye(3))
    tempco, scale_tempco = 1e-6 * preset.bias_tempco_ug_per_K, 1e-6 * preset.scale_tempco_ppm_per_K
    # The sheet's linearity is the deviation at full scale; an odd transfer keeps most of it out of the range of 1 g.
    cubic = 1e-2 * preset.linearity_pct_fs / preset.range_g**2
    return Truth(
        serial=serial,
        bias_g=np.asarray(preset.bias_mean_g) + np.asarray(preset.bias_sd_g) * normal[0],
        scale_ppm=preset.scale_sd_ppm * normal[1],
        misalignment=skew,
        bias_tempco=tempco * normal[2],
        bias_tempco_quadratic=QUADRATIC_PER_K * tempco * normal[3],
        scale_tempco=scale_tempco * normal[4],
        scale_tempco_quadratic=QUADRATIC_PER_K * scale_tempco * normal[5],
        cubic=cubic * np.tanh(normal[6]),
        slot_rotation=slot_rotation,
        output_scale=output_scale,
        zero_level=preset.zero_level,
        supply_ratio=1.0 + preset.ratiometric * (supply_ratio - 1.0),
        supply_gain=(RATIOMETRIC_ERROR if preset.ratiometric else REJECTION)
        * float(stream(seed, serial, "supply").standard_normal()),
    )


class PlantDevices:
    """The units of a lot, computed together."""

    def __init__(
        self,
        preset: Preset,
        truths: Sequence[Truth],
        turn_on: Sequence[np.random.Generator] = (),
        supply_drift: Callable[[Array], Array | float] = lambda _: 0.0,
    ) -> None:
        self._preset = preset
        self._supply_drift = supply_drift  # relative, of the slots at instants (n,)
        self._turn_on = list(turn_on)  # a stream a unit, for what each switching on changes
        self._lsb = float(np.float32(preset.lsb))  # as the reader's register tells it
        self._bias = self._first_bias = np.stack([t.bias_g for t in truths])
        self._scale = np.stack([1.0 + 1e-6 * t.scale_ppm for t in truths])
        self._matrix = np.stack([t.misalignment for t in truths])
        self._bias_t = np.stack([t.bias_tempco for t in truths])
        self._bias_t2 = np.stack([t.bias_tempco_quadratic for t in truths])
        self._scale_t = np.stack([t.scale_tempco for t in truths])
        self._scale_t2 = np.stack([t.scale_tempco_quadratic for t in truths])
        self._cubic = np.stack([t.cubic for t in truths])
        self._ratio = np.array([t.supply_ratio for t in truths])[:, None]
        self._gain = self._ratio
        self._supply_gain = np.array([t.supply_gain for t in truths])[:, None]
        self._shift = np.zeros((len(truths), 1))
        self._offset_counts = np.zeros((len(truths), 3))
        self.ripple = (0.0, 0.0)  # on the supply: amplitude over the nominal voltage, and Hz
        self._regulator_hz = np.array([REGULATOR_HZ * 2.0 ** float(np.tanh(t.supply_gain / REJECTION)) for t in truths])

    def output(self, force: Array, temperature: Array) -> Array:
        """Output without noise, (n, s, 3) in g, under force (n, s, 3) in g at ``temperature`` (n, s) in °C."""
        theta = (temperature - REFERENCE_C)[..., None]
        along = rotate(self._matrix, force)
        along = along + self._cubic * force**3
        bias = self._bias + theta * (self._bias_t + theta * self._bias_t2)
        scale = self._scale * (1.0 + theta * (self._scale_t + theta * self._scale_t2))
        return bias + scale * along

    def switched_on(self) -> None:
        """The devices come on again: the bias of none is quite where it was."""
        if self._turn_on:
            drawn = np.stack([rng.standard_normal(3) for rng in self._turn_on])
            self._bias = self._first_bias + 1e-6 * self._preset.bias_stability_ug * drawn

    def bias_of(self, serial: str, truths: Sequence[Truth]) -> Array:
        """Bias of a unit since it was last switched on, (3,), g."""
        return self._bias[[truth.serial for truth in truths].index(serial)]

    def shift_bias(self, unit: int, step_g: float) -> None:
        """Damage: the bias of a unit moves for good."""
        self._first_bias, self._bias = self._first_bias.copy(), self._bias.copy()
        self._first_bias[unit] += step_g
        self._bias[unit] = self._bias[unit] + (step_g if self._bias is not self._first_bias else 0.0)

    def set_offsets(self, unit: int, steps: Sequence[int]) -> None:
        """Offset registers of a unit (3,), which add to its counts."""
        self._offset_counts = self._offset_counts.copy()
        self._offset_counts[unit] = float(self._preset.offset_step) * np.asarray(steps, dtype=np.float64)

    def supply(self, part: Array) -> None:
        """Supplies at ``part`` (s,) of what they were: ratiometric outputs follow, the bias of others moves."""
        change = part[:, None] - 1.0
        besides = 1.0 + self._supply_gain * change
        if self._preset.ratiometric:
            self._gain = self._ratio * (1.0 + self._preset.ratiometric * change) * besides
        else:
            self._gain = self._ratio * besides
            self._shift = SUPPLY_SHIFT_G * change

    def ripple_response(self, hertz: float) -> NDArray[np.complex128]:
        """Response to a ripple of the supply at ``hertz`` Hz over that to a slow change, (s,), complex.

        The regulator inside loses its gain above a corner; what passes it is filtered by the output stage.
        """
        through = (1.0 + 1j * hertz / self._regulator_hz) / (1.0 + 1j * hertz / HIGHEST_HZ)
        return np.asarray(through / (1.0 + 1j * hertz / self._preset.passband_hz))

    def _ripple(self, time: Array) -> Array:
        """Change of the supply at instants (n,) as the units feel it, (n, s, 1)."""
        share, hertz = self.ripple
        turned = np.exp(2j * np.pi * hertz * np.asarray(time))[:, None] * self.ripple_response(hertz)
        return np.asarray(share * turned.imag[..., None])

    def counts(self, output: Array, time: Array | None = None) -> Counts:
        """Codes of the converter for outputs (n, s, 3) in g at instants (n,): supply, clipping at range and codes, rounding."""
        preset = self._preset
        drift = 0.0 if time is None else np.asarray(self._supply_drift(time))[..., None]
        wave = self._ripple(time) if time is not None and self.ripple[0] > 0.0 else 0.0
        shift = self._shift + (0.0 if preset.ratiometric else SUPPLY_SHIFT_G) * wave
        inside = np.clip(output + shift, -preset.range_g, preset.range_g)
        drift = drift + wave
        gain = self._gain * (1.0 + preset.ratiometric * drift)
        raw = np.rint(gain * (preset.zero_level + preset.scale * inside) / self._lsb)
        raw = raw + self._offset_counts
        return np.clip(raw, -preset.largest_count - 1, preset.largest_count).astype(np.int64)


def rotate(matrices: Array, vectors: Array) -> Array:
    """Matrices (s, 3, 3) times vectors (n, s, 3); written out, since BLAS sums in an order that depends on n."""
    m, v = matrices, vectors
    return np.stack(
        [m[:, i, 0] * v[..., 0] + m[:, i, 1] * v[..., 1] + m[:, i, 2] * v[..., 2] for i in range(3)], axis=-1
    )


def rotation(vector: Array) -> Array:
    """The rotation matrix (3, 3) of a small rotation vector (3,), rad (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def keyed_normal(seed: int, channel: int, tick: int, n: int) -> NDArray[np.float64]:
    """``n`` standard normal numbers that depend on seed, channel and tick only.

    A stream would move on with every reading; a plant that is resumed without its readings, or is read more often, draws these.
    """
    return np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, channel, tick])).standard_normal(n)
