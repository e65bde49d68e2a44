from dataclasses import replace

import numpy as np

from inertial.estimation.alternative import Array, Handling, Misfit, soaks
from inertial.estimation.lot import Lot
from inertial.state import History

_TAUS = 5  # values of the time constant in the first search
_BETWEEN = 9  # number of refined values around one of them
_SHARES = (
    0.05,
    1.5,
)  # shortest and longest time constant over the soak's duration; a longer one is a thermometer offset


class SoakTooEarly(Handling):
    """A soak measured before the sensing elements reach the temperature reading: the gap decays with one time constant.

    The output depends on the element's temperature, T + ΔT₀·exp(−(t − t₀)/τ) from the first dwell of the soak on.
    """

    id = "soak_too_early"
    symbol = "ΔT₀"
    equation = "E(T + ΔT₀·e^(−(t − t₀)/τ)) − E(T) in one soak, all units"
    breaker = "wait in this soak until the outputs stand still, and measure it again"
    hides_behind = ("thermal_lag", "scale_temperature_quadratic", "bias_temperature_quadratic", "thermal_hysteresis")
    fewest_units = 1
    in_part = False

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """Every soak with several time constants, if there are at least two soaks."""
        number = int(soaks(lot.state).max()) + 1
        if number < 2:
            return []
        shares = np.geomspace(*_SHARES, _TAUS)
        spans = [float(np.ptp(lot.state.time[0, soaks(lot.state) == k])) for k in range(number)]
        return [
            {"soak": float(k), "tau": span * share} for k, span in enumerate(spans) if span for share in shares.tolist()
        ]

    def near(self, lot: Lot, **location: float) -> list[dict[str, float]]:
        """Time constants up to the neighbours in :meth:`locations`."""
        step = (_SHARES[1] / _SHARES[0]) ** (1.0 / (_TAUS - 1))
        return [{**location, "tau": location["tau"] * step**x} for x in np.linspace(-1.0, 1.0, _BETWEEN)]

    def change(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """The contribution of a gap of one kelvin at the first dwell, by each unit's temperature coefficients."""
        if slope is None:
            return np.zeros((*lot.state.time.shape, len(lot.state.axes), 1))
        fading = _fading(lot, lot.state.time, np.full(len(lot.state.time), location["tau"]), location["soak"])
        return (slope * fading[..., None])[..., None]

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        return (
            f"soak {int(location['soak']) + 1} was measured too early: the sensing elements began it {size[0]:+.2f} K from the "
            f"reading and approached it with a time constant of about {location['tau']:.0f} s"
        )

    def settled(self, lot: Lot, size: Array, misfit: Misfit, **location: float) -> Lot | None:
        """With the elements' temperatures instead of the readings; gap and time constant are fitted for each unit."""
        from scipy.optimize import minimize  # noqa: PLC0415  # a quarter of a second, and few lots need it

        gaps, taus = np.full(len(lot.state.time), float(size[0])), np.full(len(lot.state.time), location["tau"])
        for unit in range(len(gaps)):
            alone = lot.units([unit])

            def left(free: Array, alone: Lot = alone, unit: int = unit) -> float:
                gap, tau = size[0] * free[0], location["tau"] * np.exp(free[1])
                return misfit(_corrected(alone, np.array([gap]), np.array([tau]), location["soak"]), (unit,))

            best = minimize(left, [1.0, 0.0], method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-2}).x
            gaps[unit], taus[unit] = size[0] * best[0], location["tau"] * np.exp(best[1])
        return _corrected(lot, gaps, taus, location["soak"])

    def dwells(self, lot: Lot, **location: float) -> list[int]:
        return np.flatnonzero(soaks(lot.state) == int(location["soak"])).tolist()


def _fading(lot: Lot, time: Array, tau: Array, soak: float) -> Array:
    """exp(−(t − t₀)/τ) at times (units, m), s, between the first and the last dwell of a soak, 0 elsewhere."""
    inside = lot.state.time[:, soaks(lot.state) == int(soak)]
    first, last = inside.min(axis=1)[:, None], inside.max(axis=1)[:, None]
    return np.where((time >= first) & (time <= last), np.exp(-np.clip(time - first, 0.0, None) / tau[:, None]), 0.0)


def _corrected(lot: Lot, gap: Array, tau: Array, soak: float) -> Lot:
    """The lot with the temperatures of the elements, gaps (units,) in K and time constants (units,) in s."""
    state = lot.state
    if state.temperature is None:
        return lot
    temperature = state.temperature + gap[:, None] * _fading(lot, state.time, tau, soak)
    history = state.history
    if history is not None:
        times = np.broadcast_to(history.time, (len(gap), history.time.size))
        history = History(history.time, history.temperature + gap[:, None] * _fading(lot, times, tau, soak))
    return replace(lot, state=replace(state, temperature=temperature, history=history, memory={}))
