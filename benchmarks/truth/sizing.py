"""Size of a hidden effect: the RMS of what the starting model cannot absorb, over the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .chain import noiseless, nominal_force
from .device import Lot
from .physics import Physics
from .scene import Scene
from .spec import STATIC_BASE, THERMAL_BASE, THERMAL_SPAN_K
from .thermal import REFERENCE_C

Floats = NDArray[np.float64]

UNSEEN_SHARE = 1e-3  # of the effect under this plan
UNSEEN_GENERIC = 0.02  # of the effect under poses all over the sphere
SMALLEST, LARGEST = 1e-13, 0.6


def rms(values: Floats) -> float:
    """Root of the mean square over everything."""
    return float(np.sqrt(np.mean(np.square(values))))


def reading(scene: Scene) -> Floats:
    """Temperature that the table of dwells reports, before the units' fixed offsets, (U, n), °C."""
    return scene.temperature + scene.reading_error


def starting_model(scene: Scene) -> tuple[str, ...]:
    """The model a diagnosis starts from under this plan."""
    warmth = reading(scene)
    return THERMAL_BASE if float(np.ptp(warmth, axis=1).max()) > THERMAL_SPAN_K else STATIC_BASE


@dataclass(frozen=True)
class Absorber:
    """Plain least squares of the starting model, per unit and axis, as an orthonormal basis (U, 3, n, p)."""

    basis: Floats

    @staticmethod
    def of(lot: Lot, scene: Scene, base: tuple[str, ...]) -> Absorber:
        """The absorber of the model `base` under the run's plan."""
        force = nominal_force(scene)
        along = np.einsum("uij,nj->uni", lot.axes(), force)
        units, count = scene.units, len(force)
        warmth = reading(scene) - REFERENCE_C
        bases = []
        for axis in range(3):
            others = [k for k in range(3) if k != axis]
            columns = {
                "bias": [np.ones((units, count))],
                "scale": [np.broadcast_to(force[:, axis], (units, count))],
                "misalignment": [np.broadcast_to(force[:, k], (units, count)) for k in others],
                "bias_temperature": [warmth],
                "scale_temperature": [warmth * along[..., axis]],
            }
            stack = np.stack([column for name in base for column in columns[name]], axis=-1)
            bases.append(np.linalg.qr(stack)[0])
        return Absorber(np.stack(bases, axis=1))

    def absorbed(self, values: Floats) -> Floats:
        """Part of `values`, (U, n, 3), that the model takes up."""
        columns = values.transpose(0, 2, 1)[..., None]
        return (self.basis @ (self.basis.transpose(0, 1, 3, 2) @ columns))[..., 0].transpose(0, 2, 1)

    def left(self, values: Floats) -> Floats:
        """Part of `values`, (U, n, 3), that the model cannot take up."""
        return values - self.absorbed(values)


def contribution(lot: Lot, scene: Scene, physics: Physics, amplitude: float) -> Floats:
    """What the effect alone adds to the output, (U, n, 3), g."""
    return noiseless(lot, scene, [(physics, amplitude)]) - noiseless(lot, scene, [])


def amplitude_for(lot: Lot, scene: Scene, physics: Physics, absorber: Absorber | None, wanted: float) -> float:
    """Amplitude at which the RMS left by `absorber` (None: the raw RMS) is `wanted`, g.

    Proportional steps find it for whatever is near linear; the rest (stops, friction) is bracketed on a logarithmic scale.
    """

    def reached(amplitude: float) -> float:
        added = contribution(lot, scene, physics, amplitude)
        return rms(added if absorber is None else absorber.left(added))

    amplitude = 1e-4
    for _ in range(6):
        value = reached(amplitude)
        if value <= 0.0 or not SMALLEST < amplitude * wanted / value < LARGEST:
            break
        if abs(value / wanted - 1.0) < 1e-3:
            return amplitude
        amplitude *= wanted / value
    low, high = np.log(SMALLEST), np.log(LARGEST)
    for _ in range(36):
        middle = (low + high) / 2.0
        low, high = (middle, high) if reached(float(np.exp(middle))) < wanted else (low, middle)
    return float(np.exp(high))
