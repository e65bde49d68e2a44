"""The bias of one axis of one unit is another in every soak."""

from typing import ClassVar

import numpy as np

from inertial.data_errors.handling.bias_jump import AXES
from inertial.estimation.alternative import Array, Handling, soaks
from inertial.estimation.lot import Lot

_FEWEST = 3
"""Soaks from which it is not the same as a bias with a temperature coefficient."""


class BiasUnsteady(Handling):
    """One axis of one unit whose bias changed from soak to soak by itself, and no other unit's.

    Slow telegraph noise of one sensor that stays at one level over a soak has the shape of any curve over temperature.
    """

    id: ClassVar[str] = "bias_unsteady"
    symbol: ClassVar[str] = "b(soak)"
    equation: ClassVar[str] = "b of each soak, one axis of one unit"
    breaker: ClassVar[str] = "the same soaks once more: an effect of the temperature returns, an unsteady bias does not"
    hides_behind: ClassVar[tuple[str, ...]] = ("bias_temperature_quadratic", "thermal_hysteresis")
    fewest_units: ClassVar[int] = 1
    in_part: ClassVar[bool] = False
    of_one_axis: ClassVar[bool] = True

    def places(self, lot: "Lot") -> list[dict[str, float]]:
        """Every axis of every unit; none where only a norm is known, or with less than three soaks."""
        if lot.radial or int(soaks(lot.state).max(initial=0)) + 1 < _FEWEST:
            return []
        units = lot.state.time.shape[0]
        return [{"unit": float(u), "axis": float(axis)} for u in range(units) for axis in range(len(AXES))]

    def change(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """One in each soak after the first, of the axis."""
        return self.of_each_unit(lot, slope, axis=place["axis"])

    def of_each_unit(self, lot: "Lot", slope: Array | None, **place: float) -> Array:
        """The same for every unit."""
        soak = soaks(lot.state)
        column = np.zeros((1, soak.size, len(AXES), int(soak.max())))
        column[0, :, int(place["axis"])] = soak[:, None] == np.arange(1, int(soak.max()) + 1)
        return column

    def describe(self, lot: "Lot", size: Array, **place: float) -> str:
        """The axis and its changes: what is linear in the temperature belongs to the bias and its temperature coefficient."""
        levels, warm = np.concatenate([[0.0], size]), _temperatures(lot)
        line = np.stack([np.ones(levels.size), warm - warm.mean()], axis=-1)
        levels = levels - line @ np.linalg.lstsq(line, levels, rcond=None)[0]
        by_soak = ", ".join(f"{1e6 * v:+.0f}" for v in levels)
        axis = AXES[int(place["axis"])]
        return (
            f"the bias of axis {axis} of the unit differs from soak to soak ({by_soak} µg from a line over temperature)"
        )


def _temperatures(lot: "Lot") -> Array:
    """Mean temperature of each soak, °C."""
    soak = soaks(lot.state)
    warm = np.zeros(soak.size) if lot.state.temperature is None else lot.state.temperature.mean(axis=0)
    return np.bincount(soak, weights=warm) / np.bincount(soak)
