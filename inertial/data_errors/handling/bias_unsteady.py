import numpy as np

from inertial.data_errors.changes import AXES, OfOneAxis, axes_of_units
from inertial.estimation.alternative import Array, soaks
from inertial.estimation.lot import Lot

_FEWEST = 3
"""Smallest number of soaks: with two it is equivalent to a bias with a temperature coefficient."""


class BiasUnsteady(OfOneAxis):
    """One axis of one unit whose bias changed from soak to soak, unlike that of any other unit.

    Slow telegraph noise of one sensor, constant within each soak, can imitate any curve over temperature.
    """

    id = "bias_unsteady"
    symbol = "b(soak)"
    equation = "b of each soak, one axis of one unit"
    breaker = "the same soaks once more: an effect of the temperature returns, an unsteady bias does not"
    hides_behind = ("bias_temperature_quadratic", "thermal_hysteresis")

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """Every axis of every unit; none with less than three soaks."""
        return axes_of_units(lot) if int(soaks(lot.state).max(initial=0)) + 1 >= _FEWEST else []

    def levels(self, lot: Lot, **location: float) -> Array:
        soak = soaks(lot.state)
        return (soak[:, None] == np.arange(1, int(soak.max()) + 1)).astype(np.float64)

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        """The axis and its changes: what is linear in the temperature belongs to the bias and its temperature coefficient."""
        soak = soaks(lot.state)
        read = np.zeros(soak.size) if lot.state.temperature is None else lot.state.temperature.mean(axis=0)
        levels, warm = np.concatenate([[0.0], size]), np.bincount(soak, weights=read) / np.bincount(soak)
        line = np.stack([np.ones(levels.size), warm - warm.mean()], axis=-1)
        levels = levels - line @ np.linalg.lstsq(line, levels, rcond=None)[0]
        by_soak = ", ".join(f"{1e6 * v:+.0f}" for v in levels)
        axis = AXES[lot.state.axes[int(location["axis"])]]
        return (
            f"the bias of axis {axis} of the unit differs from soak to soak ({by_soak} µg from a line over temperature)"
        )
