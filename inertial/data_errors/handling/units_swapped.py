from dataclasses import replace

import numpy as np

from inertial.arrays import Flags
from inertial.data_errors.exchanged import EDGE, PlainFit
from inertial.estimation.alternative import Array, Handling, Misfit, by_block
from inertial.estimation.lot import Lot
from inertial.state import History, State


class UnitsSwapped(Handling):
    """Two units that changed places, cables or names during the run: no coefficient, their readings are the other's."""

    id = "units_swapped"
    symbol = "a ↔ b"
    equation = "E_b − E_a in unit a, the opposite in unit b, from a dwell on or for a while"
    breaker = "the serial numbers of both units in their seats, and a pose of the first half once more"
    hides_behind = ("misalignment_temperature", "scale_temperature_quadratic")
    in_part = False
    of_one = 1.25  # part of a difference between two units is no exchange

    def places(self, lot: Lot) -> list[dict[str, float]]:
        """Pairs whose residuals by a plain fit are opposite to each other and vanish with an exchange, in the best dwells."""
        fit = _plain_fit(lot)
        return [
            {"unit": float(a), "other": float(b), "dwell": float(first), "until": float(end)}
            for a, b in fit.pairs()
            for first, end in fit.ranges(a, b)
        ]

    def placed(self, lot: Lot, **place: float) -> dict[str, float]:
        """In the dwells in which an exchange leaves least: between dwells that were left out all were equally good."""
        near = _plain_fit(lot).ranges(int(place["unit"]), int(place["other"]), around=0)
        return {**place, "dwell": float(near[0][0]), "until": float(near[0][1])} if near else place

    def looks(self, lot: Lot, places: int) -> int:
        """Every pair in every range of dwells."""
        units, n = lot.state.time.shape
        return units * (units - 1) // 2 * (n - 2 * EDGE + 1) ** 2 // 2

    def change(self, lot: Lot, slope: Array | None, **place: float) -> Array:
        """The difference of the readings of the two units, in the dwells."""
        one, other, then = _places(lot, **place)
        column = np.zeros((*lot.state.time.shape, len(lot.state.axes), 1))
        column[[one, other], ..., 0] = (lot.output[[one, other]] - _of_other(lot, one, other)) * then[:, None]
        return column

    def columns(self, lot: Lot, slope: Array | None, **place: float) -> Array:
        """The same by block: two units are affected."""
        return by_block(self.change(lot, slope, **place))

    def describe(self, lot: Lot, size: Array, **place: float) -> str:
        one, other, then = _places(lot, **place)
        apart = 1e6 * float(np.sqrt(np.mean((lot.output[one, then] - _of_other(lot, one, other)[0, then]) ** 2)))
        back = int(place["until"] - place["dwell"])
        back = "" if place["until"] >= then.size else f" for {back} dwells"
        return f"exchanged before this dwell{back}, readings {apart:.0f} µg apart; they are exchanged back"

    def settled(self, lot: Lot, size: Array, misfit: Misfit, **place: float) -> Lot | None:
        """With the readings exchanged back: the temperatures, too, if the model fits better with them."""
        one, other, _ = _places(lot, **place)
        outputs = _outputs_exchanged(lot, **place)
        whole = replace(outputs, state=_temperatures_exchanged(lot.state, **place))
        misfits = [misfit(each.units([one, other]), (one, other), own_noise=True) for each in (outputs, whole)]
        return outputs if misfits[0] <= misfits[1] else whole


def _places(lot: Lot, **place: float) -> tuple[int, int, Flags]:
    """The two units, and the dwells (n,) in which both were measured as the other."""
    one, other = int(place["unit"]), int(place["other"])
    there = np.isfinite(lot.error[[one, other]]).all(axis=(0, 2))
    return one, other, there & _within(lot.state.time.shape[1], **place)


def _within(n: int, **place: float) -> Flags:
    """Dwells (n,) from the first of an exchange to its end."""
    return (np.arange(n) >= place["dwell"]) & (np.arange(n) < place["until"])


def _plain_fit(lot: Lot) -> PlainFit:
    """The fit by which pairs are found."""
    there = np.all(np.isfinite(lot.error), axis=-1)
    return PlainFit(lot.output, lot.state.force, lot.state.theta, there, lambda one, other: _of_other(lot, one, other))


def _of_other(lot: Lot, one: int, other: int) -> Array:
    """Outputs (2, n, 3) of two units, each as that of the other: over the other's nominal scale; g."""
    outputs = lot.output[[other, one]]
    return outputs if lot.scale is None else outputs * (lot.scale[[other, one]] / lot.scale[[one, other]])[:, None]


def _outputs_exchanged(lot: Lot, **place: float) -> Lot:
    """The lot with the outputs of two units exchanged in the dwells, and what is known of their noise."""
    one, other, then = _places(lot, **place)
    output, error = lot.output.copy(), lot.error.copy()
    pair, here = [one, other], then[:, None]
    output[pair] = np.where(here, _of_other(lot, one, other), lot.output[pair])
    error[pair] = np.where(here, lot.error[[other, one]], lot.error[pair])
    return replace(lot, output=output, error=error)


def _temperatures_exchanged(state: State, **place: float) -> State:
    """A state with the temperatures of two units exchanged in the dwells."""
    pair = [int(place["unit"]), int(place["other"])]
    if state.temperature is None:
        return state
    n = state.time.shape[1]
    history = state.history
    if history is not None and history.temperature.ndim > 1:
        start = float(state.time[pair, int(place["dwell"])].min())
        end = np.inf if place["until"] >= n else float(state.time[pair, int(place["until"])].min())
        then = (history.time >= start) & (history.time < end)
        history = History(history.time, _exchanged(history.temperature, pair, then))
    then = _within(n, **place)
    return replace(state, temperature=_exchanged(state.temperature, pair, then), history=history, memory={})


def _exchanged(values: Array, pair: list[int], then: Flags) -> Array:
    """Values (units, m) with two rows exchanged in some columns (m,)."""
    changed = values.copy()
    changed[pair] = np.where(then, values[pair[::-1]], values[pair])
    return changed
