from dataclasses import replace

import numpy as np

from inertial import operators
from inertial.estimation.alternative import Array, Handling, Misfit
from inertial.estimation.lot import Lot
from inertial.state import History, State

_FASTEST, _SLOWEST, _GRID = 30.0, 3000.0, 12  # s, s, number of values of the time constant
_BETWEEN = 9  # number of refined values around one of the grid
_SPREAD = 3.0  # factor within which the time constant of each unit is searched
_EXACT = 1e-3  # tolerance of the logarithm of a time constant


class NotSoaked(Handling):
    """Temperatures of the devices that relax to the reading with one time constant, for all units.

    The thermometer measures the air or a plate; the device follows, T_d' = (T − T_d)/τ, and the output depends on T_d.
    """

    id = "device_not_soaked"
    symbol = "τ"
    equation = "E(T_d) − E(T), T_d′ = (T − T_d)/τ, all units"
    breaker = "soaks until the outputs stand still, or the devices' own thermometers"
    hides_behind = ("thermal_lag",)
    fewest_units = 1
    in_part = False
    # a delay in a fiftieth of the temperature coefficients, or of opposite sign, is an effect with a lag of its own: correcting
    # the temperatures for it would increase the residuals
    of_one = 3.0

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """Time constants, where the temperature changes."""
        state = lot.state
        if state.temperature is None or float(np.ptp(state.temperature)) < 1.0:
            return []
        return [{"tau": float(tau)} for tau in np.geomspace(_FASTEST, _SLOWEST, _GRID)]

    def near(self, lot: Lot, **location: float) -> list[dict[str, float]]:
        """Time constants up to the neighbours in :meth:`locations`."""
        step = (_SLOWEST / _FASTEST) ** (1.0 / (_GRID - 1))
        return [{**location, "tau": location["tau"] * step**x} for x in np.linspace(-1.0, 1.0, _BETWEEN)]

    def change(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """Contribution of the temperature lag by each unit's coefficients; its size is 1 if these are known exactly."""
        units, n = lot.state.time.shape
        if slope is None:
            return np.zeros((units, n, len(lot.state.axes), 1))
        behind = _temperature(lot.state, location["tau"]) - _temperature(lot.state, 0.0)
        return (slope * behind[..., None])[..., None]

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        behind = np.abs(_temperature(lot.state, location["tau"]) - _temperature(lot.state, 0.0))
        alone = "unit" in location
        behind = behind[int(location["unit"])] if alone else behind
        return (
            f"{'the unit follows' if alone else 'the devices follow'} the temperature reading with a time constant "
            f"of {location['tau']:.0f} s, up to {float(behind.max()):.1f} K behind it; soak longer, or measure "
            "the device's temperature"
        )

    def settled(self, lot: Lot, size: Array, misfit: Misfit, **location: float) -> Lot | None:
        """With the temperatures of the devices instead of the readings; the time constant is fitted for each unit."""
        from scipy.optimize import minimize_scalar  # noqa: PLC0415  # a quarter of a second, and few lots need it

        each = np.zeros(lot.state.time.shape[0])
        middle, reach = float(np.log(location["tau"])), float(np.log(_SPREAD))
        for unit in [int(location["unit"])] if "unit" in location else range(each.size):
            alone = lot.units([unit])

            def left(log_tau: float, alone: Lot = alone, unit: int = unit) -> float:
                return misfit(replace(alone, state=delayed(alone.state, np.array([np.exp(log_tau)]))), (unit,))

            bounds = (middle - reach, middle + reach)
            minimum = minimize_scalar(left, bounds=bounds, method="bounded", options={"xatol": _EXACT})
            each[unit] = float(np.exp(minimum.x))
        return replace(lot, state=delayed(lot.state, each))


def delayed(state: State, tau: Array) -> State:
    """The state with temperatures that follow the readings with time constants (units,), s; zero: the readings."""
    if state.temperature is None:
        return state
    history = state.history
    if history is None:
        return replace(state, temperature=_lag(state.time, state.temperature, tau), memory={})
    recorded = np.broadcast_to(history.temperature, (len(tau), history.time.size))
    late = _lag(np.broadcast_to(history.time, recorded.shape), recorded, tau)
    each = [np.interp(t, history.time, h) for t, h in zip(state.time, late, strict=True)]
    return replace(state, temperature=np.stack(each), history=History(history.time, late), memory={})


def _lag(time: Array, temperature: Array, tau: Array) -> Array:
    each = zip(time, temperature, tau.tolist(), strict=True)
    return np.stack([operators.first_order_lag(t, v, s) if s > 0.0 else v for t, v, s in each])


def _temperature(state: State, tau: float) -> Array:
    """Temperatures of the devices at the dwells, (units, n), °C; the readings for a time constant of zero."""
    return state.temperature_operator(
        ("device_not_soaked", tau), lambda time, value: operators.first_order_lag(time, value, tau) if tau else value
    )
