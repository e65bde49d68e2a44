"""Entries of ``[uncertainty]`` as influences on the dwells of a lot, by the equations of each contribution."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, Index
from inertial.state import State
from inertial.uncertainty.influences import Errors, InputQuantity, Scattered, harmonic, theta
from schemas.uncertainty import OF_STATIC, Entry, StandardUncertainty, Uncertainty
from schemas.validity import Stability


@dataclass(frozen=True)
class DwellConditions:
    """The dwells that the influences act on.

    state : all dwells of the lot; soak : (n,), number of the soak of each dwell; target_C : (n,), its temperature
    soak_s : time at a temperature before its first dwell; room_C : before the first soak
    scale : (m,), output per g, of the axes with an output
    """

    state: State
    soak: Index
    target_C: Array
    soak_s: float
    room_C: float
    scale: Array


@dataclass(frozen=True)
class UncertaintySource:
    """The source of a contribution: its entry, and the standard uncertainty stated there."""

    entry: Entry
    stated: StandardUncertainty


def merged(station: Uncertainty | None, recipe: Uncertainty | None) -> Uncertainty | None:
    """The station's statement, with entries of the recipe replacing those of the same key; None where neither states any."""
    if station is None or recipe is None:
        return station or recipe
    grades = {station.grade_source, recipe.grade_source}
    weakest = next(name for name in ("assumed", "data_sheet", "certificates") if name in grades)
    return Uncertainty.model_validate({**station.model_dump(), **recipe.model_dump(), "grade_source": weakest})


def sources(stated: Uncertainty) -> dict[str, UncertaintySource]:
    """The contributions that a statement has, by name."""
    by_name: dict[str, UncertaintySource] = {}
    for name, entry in stated.entries.items():
        if name == "gravity" and stated.gravity is not None:
            by_name[name] = UncertaintySource(entry, stated.gravity.relative())
        elif name == "settling":
            by_name[name] = UncertaintySource(entry, entry.standard())
        else:
            by_name |= {
                label: UncertaintySource(entry, entry.standard(part))
                for part, label in _PARTS.get(name, {"": name}).items()
            }
    return by_name


_PARTS: dict[str, dict[str, str]] = {
    "thermometer": {"offset": "thermometer_offset", "slope": "thermometer_slope", "soak": "thermometer_soak"},
    "reader": {"gain": "reader_gain", "offset": "reader_offset", "inl": "reader_inl"},
    "timing": {"wait": "timing", "creep": "creep"},
    "vibration": {"rms": "vibration"},
}


def reads_own_temperature(stated: Uncertainty, stability: Stability | None) -> bool:
    """Whether fit and user read the same thermometer of the device, so that its errors are in the coefficients alike."""
    entry, user = stated.thermometer, stability is None or stability.temperature_of == "device"
    return entry is not None and entry.measures == "device" and user


def left_out(stated: Uncertainty) -> list[str]:
    """The contributions that a statement has no figure for, and does not call exact, by name."""
    names: list[str] = []
    for name in OF_STATIC:
        entry: Entry | None = getattr(stated, name)
        parts = _PARTS.get(name, {"": name})
        names += [label for part, label in parts.items() if entry is None or not entry.states(part)]
    return names


def influences(
    stated: Uncertainty, at: DwellConditions, stability: Stability | None = None
) -> tuple[list[InputQuantity], list[Scattered]]:
    """The influences of a statement on some dwells; those whose effect cancels for the user are omitted.

    Parameters
    ----------
    stability : of the device: whose temperature the user corrects with, and whether its output follows the supply
    """
    inputs: list[InputQuantity] = []
    known = sources(stated)
    for name, errors, u in _all(stated, at, stability):
        if u > 0.0:
            entry = known[name].entry
            inputs.append(InputQuantity(name, errors, u, entry.scope, entry.dof or float("inf")))
    pose = stated.pose
    if pose is None or pose.seen_in_residuals or not (u := pose.standard().u) > 0.0:
        return inputs, []  # the repeatability of the poses is left out where the fit's own scatter shows it already
    return inputs, [Scattered("pose", u, u, pose.scope, pose.dof or float("inf"))]


def _all(stated: Uncertainty, at: DwellConditions, stability: Stability | None) -> Iterator[tuple[str, Errors, float]]:
    if stated.gravity is not None:
        yield "gravity", Errors(gravity=1.0), stated.gravity.relative().u
    for name, errors in (
        ("level", Errors(level=(1.0, 0.0))), ("level", Errors(level=(0.0, 1.0))), ("orthogonality", Errors(orthogonality=1.0)),
        ("outer_offset", Errors(outer=1.0)), ("inner_offset", Errors(inner=1.0)),
    ):  # fmt: skip
        entry = getattr(stated, name)
        if entry is not None:
            yield name, errors, entry.standard().u
    yield from _harmonics(stated, at)
    if stated.seat is not None:
        for axis in range(3):
            yield "seat", Errors(seat=_unit_vector(axis)), stated.seat.standard().u
    yield from _temperature(stated, at, stability)
    yield from _electrical(stated, at, stability)


def _harmonics(stated: Uncertainty, at: DwellConditions) -> Iterator[tuple[str, Errors, float]]:
    entry, state = stated.harmonics, at.state
    if entry is None or state.outer is None or state.inner is None:
        return
    for axis in entry.axes:
        angle = state.outer if axis == "outer" else state.inner
        for order in entry.orders:
            for phase in ("sin", "cos"):
                wave = harmonic(angle, order, phase)
                errors = Errors(outer=wave) if axis == "outer" else Errors(inner=wave)
                yield "harmonics", errors, entry.standard().u


def _temperature(
    stated: Uncertainty, at: DwellConditions, stability: Stability | None
) -> Iterator[tuple[str, Errors, float]]:
    """Errors of the temperature; none where fit and user read the same thermometer of the device."""
    entry = stated.thermometer
    if reads_own_temperature(stated, stability):
        return
    if entry is not None:
        yield "thermometer_offset", Errors(temperature=1.0), entry.standard("offset").u
        yield "thermometer_slope", Errors(temperature=theta(at.state)), entry.standard("slope").u
        for soak in np.unique(at.soak):
            yield "thermometer_soak", Errors(temperature=(at.soak == soak).astype(float)), entry.standard("soak").u
    if stated.gradient is not None:
        yield "gradient", Errors(temperature=1.0), stated.gradient.standard().u
    if stated.settling is not None:
        yield "settling", Errors(temperature=remainder(at, max(stated.settling.tau_s))), 1.0 / np.sqrt(3.0)


def remainder(at: DwellConditions, tau_s: float) -> Array:
    """The remainder of the step to the soak of each dwell at its first dwell, (n,), K: reading minus element."""
    out = np.zeros(at.soak.size)
    before = at.room_C
    for soak in np.unique(at.soak):
        here = at.soak == soak
        target = float(at.target_C[here][0])
        out[here] = (target - before) * np.exp(-at.soak_s / tau_s)
        before = target
    return out


def _electrical(
    stated: Uncertainty, at: DwellConditions, stability: Stability | None
) -> Iterator[tuple[str, Errors, float]]:
    if stated.supply is not None and stability is not None and stability.ratiometric > 0.0:
        yield "supply", Errors(gain=stability.ratiometric), stated.supply.standard().u
    scales = [(axis, float(scale)) for axis, scale in zip(at.state.axes, at.scale, strict=True)]
    if stated.reader is not None:
        yield "reader_gain", Errors(gain=1.0), stated.reader.standard("gain").u
        for name, part in (("reader_offset", "offset"), ("reader_inl", "inl")):
            for axis, scale in scales:
                yield name, Errors(offset=_unit_vector(axis, scale)), stated.reader.standard(part).u
    rate = at.state.temperature_rate
    if stated.timing is not None and rate is not None:
        yield "timing", Errors(temperature=rate / 60.0), stated.timing.standard("wait").u
    if stated.timing is not None:
        for axis, scale in scales:
            yield "creep", Errors(offset=_unit_vector(axis, scale)), stated.timing.standard("creep").u
    if stated.vibration is not None:
        u = 1e-6 * stated.vibration.coefficient_ug_g2 * stated.vibration.standard("rms").u ** 2
        for axis, scale in scales:
            yield "vibration", Errors(offset=_unit_vector(axis, scale)), u


def _unit_vector(axis: int, size: float = 1.0) -> tuple[float, float, float]:
    x, y, z = (size if k == axis else 0.0 for k in range(3))
    return x, y, z
