"""Hidden effects of the transfer curve: springs, pick-offs and converters that follow the force of the moment."""

from __future__ import annotations

import numpy as np
from scipy.special import roots_hermitenorm

from benchmarks.strangers.kinds import Change, Scene, kind
from benchmarks.strangers.station import Floats, force_of

SMALL = 1e-3  # how far a curve bends while its shape is taken; the amplitude is set afterwards


@kind("effect", catalogue=("third_order",))
def hard_spring(scene: Scene) -> Change:
    """A spring that stiffens, x + c·x³ = a: a cubic with a small fifth order."""
    force = scene.sensed()
    deflection = force.copy()
    for _ in range(12):
        deflection -= (deflection + SMALL * deflection**3 - force) / (1.0 + 3.0 * SMALL * deflection**2)
    return Change(added=scene.gains() * (deflection - force) / SMALL)


@kind("effect", catalogue=("second_order",))
def bent_pickoff(scene: Scene) -> Change:
    """A pick-off whose gap is not in the middle: exponential in the deflection, a quadratic nearly alone."""
    force = scene.sensed()
    return Change(added=scene.gains() * (np.expm1(SMALL * force) / SMALL - force) / SMALL)


@kind("effect", catalogue=("scale_asymmetry",))
def two_springs(scene: Scene) -> Change:
    """Another scale for + than for −, the change at zero rounded over two milli-g."""
    force = scene.sensed()
    return Change(added=scene.gains() * 0.5 * np.sqrt(force**2 + 2e-3**2))


@kind("effect", catalogue=("cross_axis_quadratic",))
def long_lever(scene: Scene) -> Change:
    """Force across the axis pulls the mass out of line, in a direction of its own: the lever gets longer."""
    force, angle = scene.sensed(), scene.lot.uniform(0.0, np.pi, scene.shape)
    across = np.cos(angle) * np.roll(force, -1, axis=-1) + np.sin(angle) * np.roll(force, -2, axis=-1)
    return Change(added=scene.gains() * 2.0 * (np.sqrt(1.0 + SMALL * across**2) - 1.0) / SMALL)


@kind("effect", catalogue=("cross_coupling",))
def leaning_pendulum(scene: Scene) -> Change:
    """A pendulum that leans under its own force sees the one across: sin of the lean times that force."""
    force, angle = scene.sensed(), scene.lot.uniform(0.0, 2.0 * np.pi, scene.shape)
    across = np.cos(angle) * np.roll(force, -1, axis=-1) + np.sin(angle) * np.roll(force, -2, axis=-1)
    return Change(added=scene.gains() * np.sin(SMALL * force) / SMALL * across)


@kind("effect", catalogue=("adc_nonlinearity",))
def converter_codes(scene: Scene) -> Change:
    """A successive-approximation converter whose bits have wrong weights: its table of codes, blurred by the samples' noise."""
    bits, units = 11, scene.shape[0]
    codes = np.arange(2**bits)
    weights = 2.0 ** np.arange(bits)
    error = scene.lot.normal(0.0, 1.0, (units, 3, bits)) * np.sqrt(weights) * (np.arange(bits) >= bits - 6)
    table = error @ ((codes[None, :] >> np.arange(bits)[:, None]) & 1)
    slope = np.linspace(-0.5, 0.5, codes.size)
    table -= table.mean(axis=-1, keepdims=True)
    table -= slope * (table @ slope / (slope @ slope))[..., None]
    reach = min(scene.devices.full_scale, 2.0)
    nodes, parts = roots_hermitenorm(9)
    noise = np.maximum(scene.devices.sample_sd, 1e-4)
    level = (scene.sensed() + scene.devices.bias)[..., None] + noise[..., None] * nodes
    index = np.clip((level + reach) / (2.0 * reach) * codes.size, 0, codes.size - 1).astype(int)
    unit, axis = np.arange(units)[:, None, None], np.arange(3)[:, None]
    blurred = table[unit, axis, index] @ (parts / parts.sum())
    return Change(added=blurred * np.abs(scene.gains()) / 2**bits)


@kind("effect", catalogue=("dead_zone", "bias_asymmetry"))
def sticking_pivot(scene: Scene) -> Change:
    """A pivot that sticks near zero: the pick-off follows the force only beyond a threshold of some ten milli-g."""
    width = scene.lot.uniform(0.02, 0.12)
    return Change(added=-scene.gains() * np.clip(scene.sensed() / width, -1.0, 1.0))


@kind("effect", catalogue=("third_order", "fifth_order", "odd_quadratic"))
def early_saturation(scene: Scene) -> Change:
    """An amplifier that saturates softly beyond nine tenths of a g, on both sides."""
    excess = (np.abs(scene.sensed()) - scene.lot.uniform(0.5, 0.75)) / 0.08
    return Change(added=-np.abs(scene.gains()) * np.sign(scene.sensed()) * 0.08 * np.logaddexp(0.0, excess))


@kind("effect", "soaks", catalogue=("second_order_temperature",))
def pickoff_moves_with_heat(scene: Scene) -> Change:
    """The pick-off's gap leaves the middle as the frame expands: a quadratic that grows with temperature."""
    gap = SMALL * (scene.day.mean(scene.day.case)[..., None] - 25.0) / 50.0
    force = scene.sensed()
    middle = np.where(np.abs(gap) > 1e-9, gap, 1e-9)
    return Change(added=scene.gains() * (np.log1p(middle * force) / middle - force) / SMALL)


@kind("effect", "supply", catalogue=("supply_sensitivity",))
def follows_supply(scene: Scene) -> Change:
    """A converter that takes a share of the supply for its reference: the scale follows the recorded voltage."""
    volts = scene.day.mean(scene.day.supply)[:, None, None]
    return Change(added=scene.gains() * scene.sensed() * (3.3 / volts - 1.0))


def way_of_force(scene: Scene) -> Floats:
    """Force along the axes (d·waypoints, u, 3) on all the way of the table, g."""
    way = scene.day.way.reshape(-1, 2)
    force = force_of(way[:, 0], way[:, 1])
    return scene.devices.sensed(np.repeat(force[:, None, :], scene.shape[0], axis=1))
