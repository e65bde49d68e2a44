from dataclasses import replace

import numpy as np

from inertial.arrays import Flags
from inertial.counts import number_of
from inertial.data_errors.exchanged import EDGE, PlainFit
from inertial.estimation.alternative import Array, Handling, Misfit, by_block
from inertial.estimation.lot import Lot
from inertial.state import History, State


class UnitsSwapped(Handling):
    """Two units whose seats, cables or serials were exchanged during the run; its only possible coefficient is 1."""

    id = "units_swapped"
    symbol = "a ↔ b"
    equation = "E_b − E_a in unit a, the opposite in unit b, from a dwell on or for a while"
    breaker = "the serial numbers of both units in their seats, and a pose of the first half once more"
    hides_behind = ("misalignment_temperature", "scale_temperature_quadratic")
    in_part = False
    of_one = 1.25  # an exchange changes the readings by the full difference of the units

    def locations(self, lot: Lot) -> list[dict[str, float]]:
        """Pairs of units with opposite residuals of a plain fit that vanish with an exchange, in the best ranges of dwells."""
        fit = _plain_fit(lot)
        return [
            {"unit": float(a), "other": float(b), "dwell": float(first), "until": float(end)}
            for a, b in fit.pairs()
            for first, end in fit.ranges(a, b)
        ]

    def placed(self, lot: Lot, **location: float) -> dict[str, float]:
        """The location with the best range of dwells: while dwells are left out, ranges that differ only in these fit equally."""
        near = _plain_fit(lot).ranges(int(location["unit"]), int(location["other"]), around=0)
        return {**location, "dwell": float(near[0][0]), "until": float(near[0][1])} if near else location

    def looks(self, lot: Lot, locations: int) -> int:
        """Number of pairs times ranges of dwells."""
        units, n = lot.state.time.shape
        return units * (units - 1) // 2 * (n - 2 * EDGE + 1) ** 2 // 2

    def change(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """The difference of the readings of the two units, in the dwells."""
        unit, other, then = _exchanged_dwells(lot, **location)
        column = np.zeros((*lot.state.time.shape, len(lot.state.axes), 1))
        column[[unit, other], ..., 0] = (lot.output[[unit, other]] - _of_other(lot, unit, other)) * then[:, None]
        return column

    def columns(self, lot: Lot, slope: Array | None, **location: float) -> Array:
        """The columns by block, (blocks, n, 1): two units are affected."""
        return by_block(self.change(lot, slope, **location))

    def describe(self, lot: Lot, size: Array, **location: float) -> str:
        unit, other, then = _exchanged_dwells(lot, **location)
        apart = 1e6 * float(np.sqrt(np.mean((lot.output[unit, then] - _of_other(lot, unit, other)[0, then]) ** 2)))
        back = int(location["until"] - location["dwell"])
        back = "" if location["until"] >= then.size else f" for {number_of(back, 'dwell')}"
        return f"exchanged before this dwell{back}, readings {apart:.0f} µg apart; they are exchanged back"

    def settled(self, lot: Lot, size: Array, misfit: Misfit, **location: float) -> Lot | None:
        """With the outputs exchanged back, and also the temperatures if the model then fits better."""
        unit, other, _ = _exchanged_dwells(lot, **location)
        outputs = _outputs_exchanged(lot, **location)
        both = replace(outputs, state=_temperatures_exchanged(lot.state, **location))
        misfits = [misfit(each.units([unit, other]), (unit, other), own_noise=True) for each in (outputs, both)]
        return outputs if misfits[0] <= misfits[1] else both


def _exchanged_dwells(lot: Lot, **location: float) -> tuple[int, int, Flags]:
    """The two units, and whether each dwell (n,) is in the exchanged range and measured in both."""
    unit, other = int(location["unit"]), int(location["other"])
    there = np.isfinite(lot.error[[unit, other]]).all(axis=(0, 2))
    return unit, other, there & _within(lot.state.time.shape[1], **location)


def _within(n: int, **location: float) -> Flags:
    """Dwells (n,) from the first of an exchange to its end."""
    return (np.arange(n) >= location["dwell"]) & (np.arange(n) < location["until"])


def _plain_fit(lot: Lot) -> PlainFit:
    """The fit whose residuals show exchanged pairs."""
    there = np.all(np.isfinite(lot.error), axis=-1)
    return PlainFit(lot.output, lot.state.force, lot.state.theta, there, lambda a, b: _of_other(lot, a, b))


def _of_other(lot: Lot, unit: int, other: int) -> Array:
    """Outputs (2, n, 3), g, of two units exchanged, each divided by the nominal scale of the unit it is assigned to."""
    outputs = lot.output[[other, unit]]
    return outputs if lot.scale is None else outputs * (lot.scale[[other, unit]] / lot.scale[[unit, other]])[:, None]


def _outputs_exchanged(lot: Lot, **location: float) -> Lot:
    """The lot with the outputs and standard errors of two units exchanged in the dwells."""
    unit, other, then = _exchanged_dwells(lot, **location)
    output, error = lot.output.copy(), lot.error.copy()
    pair, here = [unit, other], then[:, None]
    output[pair] = np.where(here, _of_other(lot, unit, other), lot.output[pair])
    error[pair] = np.where(here, lot.error[[other, unit]], lot.error[pair])
    return replace(lot, output=output, error=error)


def _temperatures_exchanged(state: State, **location: float) -> State:
    """A state with the temperatures of two units exchanged in the dwells."""
    pair = [int(location["unit"]), int(location["other"])]
    if state.temperature is None:
        return state
    n = state.time.shape[1]
    history = state.history
    if history is not None and history.temperature.ndim > 1:
        start = float(state.time[pair, int(location["dwell"])].min())
        end = np.inf if location["until"] >= n else float(state.time[pair, int(location["until"])].min())
        then = (history.time >= start) & (history.time < end)
        history = History(history.time, _exchanged(history.temperature, pair, then))
    then = _within(n, **location)
    return replace(state, temperature=_exchanged(state.temperature, pair, then), history=history, memory={})


def _exchanged(values: Array, pair: list[int], then: Flags) -> Array:
    """Values (units, m) with two rows exchanged in some columns (m,)."""
    changed = values.copy()
    changed[pair] = np.where(then, values[pair[::-1]], values[pair])
    return changed
