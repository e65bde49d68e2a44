"""True values of the figures of the procedures: the plant's physics, by arithmetic that no reduction of the product uses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from scipy import signal

from benchmarks.bent_springs import bends
from stations.plant.families.acutrol_3000 import radius_error

if TYPE_CHECKING:
    from stations.plant.plant import Plant

Array = np.ndarray[Any, np.dtype[np.float64]]
SUPPLIES = (12.0, 10.0, 11.0, 12.5, 13.0)  # one is farthest from the nominal: no tie of the largest departure
PULSE_G, PULSE_S = 30.0, 2e-3
WARM_G, WARM_S, BAND_UG = 1e-2, 120.0, 1000.0
CYCLES, CYCLE_S, WINDOW_S = 10, 74.0, 10.0  # power cycles: off, on, the record, and the orders between
FLAT_HZ = 500.0
RADIUS_M = 0.5
TWO_RADII_M = (0.5, 0.3)
FULL_SCALE_G = 30.0


def truths(procedure: str, plant: Plant, k: int) -> dict[str, float]:
    """True values of the figures of a procedure for unit k, for axis z where there are several."""
    return TRUTHS[procedure](plant, k)


def _transverse(plant: Plant, k: int) -> dict[str, float]:
    static = plant.truth(plant.serials[k])
    return {"transverse_sensitivity_percent": 100.0 * float(np.hypot(*static.misalignment[2, :2]))}


def _supply(plant: Plant, k: int) -> dict[str, float]:
    static = plant.truth(plant.serials[k])
    gain = 1.0 + 1e-6 * static.scale_ppm[2]
    shift = [static.supply_gain * (volt / SUPPLIES[0] - 1.0) for volt in SUPPLIES]
    zero = [0.05 * (volt / SUPPLIES[0] - 1.0) for volt in SUPPLIES]
    return {
        "supply_zero_ug_V": 1e6 * 0.05 / SUPPLIES[0],
        "supply_zero_percent_fs": 100.0 * max(zero, key=abs) * gain / plant.preset.range_g,
        "supply_sensitivity_percent": 100.0 * max(shift, key=abs),
    }


def _random(plant: Plant, k: int) -> dict[str, float]:
    own, static = plant.bench.units[k], plant.truth(plant.serials[k])
    shift = own.quadratic[2] + 3.0 * static.cubic[2] * plant.bench.gravity
    return {"vibration_rectification_ug_g2": 1e6 * (1.0 + 1e-6 * static.scale_ppm[2]) * shift}


def _turn_on(plant: Plant, k: int) -> dict[str, float]:
    """Between switchings, and the wander of the noise over the cycles, which is part of the scatter from cycle to cycle."""
    f = np.geomspace(1e-7, 10.0, 50_001)
    density = _flicker(plant, f) + 2.0 * (plant.preset.rate_random_walk_ug / (2.0 * np.pi * f)) ** 2
    gaps = CYCLE_S * np.arange(1, CYCLES)
    apart = [np.trapezoid(density * np.sinc(WINDOW_S * f) ** 2 * (1.0 - np.cos(2.0 * np.pi * f * d)), f) for d in gaps]
    pairs = np.arange(CYCLES - 1, 0, -1)
    wander = float(np.sum(pairs * np.array(apart)) / np.sum(pairs))
    value = float(np.sqrt(plant.preset.bias_stability_ug**2 + wander))
    return dict.fromkeys(("turn_on_repeatability_ug", "turn_on_upper_limit_ug"), value)


def _flicker(plant: Plant, f: Array) -> Array:
    """One-sided density of the 1/f noise, µg²/Hz."""
    constants = 0.1 * 3.0 ** np.arange(-6, 11)
    share = plant.preset.bias_instability_ug**2 / np.pi * np.log(3.0)
    return np.asarray(sum(4.0 * share * c / (1.0 + (2.0 * np.pi * f * c) ** 2) for c in constants))


def _warm_up(plant: Plant, k: int) -> dict[str, float]:
    return {"warm_up_s": WARM_S * float(np.log(1e6 * WARM_G / BAND_UG))}


def _chain(own: Any) -> Array:
    """Denominator of sprung mass and low-pass in s."""
    mass, pole = 2.0 * np.pi * own.natural_hz, 2.0 * np.pi * own.low_pass_hz
    return np.asarray(
        np.polymul([1.0 / mass**2, 2.0 * own.damping / mass, 1.0], [1.0 / pole**2, np.sqrt(2.0) / pole, 1.0]),
        dtype=np.float64,
    )


def _frequency(plant: Plant, k: int) -> dict[str, float]:
    own, static = plant.bench.units[k], plant.truth(plant.serials[k])
    grid = np.linspace(10.0, 4000.0, 400_001)
    answer: Any = signal.freqs([1.0], _chain(own), worN=cast("Any", 2.0 * np.pi * grid))
    size = np.abs(answer[1])
    f = 10.0 * 2.0 ** (np.arange(40) / 4.0)
    at: Any = signal.freqs([1.0], _chain(own), worN=cast("Any", 2.0 * np.pi * f[f <= FLAT_HZ]))
    apart = np.abs(at[1]) / np.abs(at[1][0]) - 1.0
    return {
        "sweep_bandwidth_hz": float(grid[np.flatnonzero(size < np.sqrt(0.5))[0]]),
        "sweep_natural_hz": own.natural_hz,
        "sweep_damping": own.damping,
        "sweep_flatness_percent": 100.0 * float(apart[np.argmax(np.abs(apart))]),
        "sweep_sensitivity_percent": 1e-4 * float(static.scale_ppm[2]),
    }


def _step(plant: Plant, k: int) -> dict[str, float]:
    own = plant.bench.units[k]
    t = np.linspace(0.0, 0.012, 240_001)
    parts: Any = signal.residue([1.0], np.polymul(np.polymul(_chain(own), [2e-6, 1.0]), [1.0, 0.0]))
    out: Any = np.real(sum(r * np.exp(p * t) for r, p in zip(parts[0], parts[1], strict=True)))
    rising = out[: int(np.argmax(out)) + 1]
    ten, ninety = np.interp([0.1, 0.9], rising, t[: rising.size])
    last = int(np.flatnonzero(np.abs(out - 1.0) > 0.02)[-1])
    edge = 1.0 + 0.02 * float(np.sign(out[last] - 1.0))
    settled = float(t[last] + (t[last + 1] - t[last]) * (edge - out[last]) / (out[last + 1] - out[last]))
    return {
        "step_settling_ms": 1e3 * (settled + own.delay_s - 2e-6 * float(np.log(2.0))),  # from 50 % of the drive
        "step_overshoot_percent": 100.0 * float(out.max() - 1.0),
        "step_rise_ms": 1e3 * float(ninety - ten),
    }


def _shock(plant: Plant, k: int) -> dict[str, float]:
    """Peak and undershoot behind the low-pass that both channels have: two poles forwards and backwards, at 6/D."""
    own, static = plant.bench.units[k], plant.truth(plant.serials[k])
    rate, n = 409600.0, 2**17
    t = np.arange(n) / rate - 0.06
    pulse = np.where((t >= 0.0) & (t <= PULSE_S), PULSE_G * np.sin(np.pi * np.clip(t, 0.0, PULSE_S) / PULSE_S), 0.0)
    f = np.fft.rfftfreq(n, 1.0 / rate)
    mass: Any = signal.freqs(
        [1.0],
        [(2.0 * np.pi * own.natural_hz) ** -2, 2.0 * own.damping / (2.0 * np.pi * own.natural_hz), 1.0],
        worN=cast("Any", 2.0 * np.pi * f),
    )
    whole: Any = signal.freqs([1.0], _chain(own), worN=cast("Any", 2.0 * np.pi * f))
    smooth = 1.0 / (1.0 + (f / (6.0 / PULSE_S)) ** 4)

    def measured(force: Array) -> tuple[float, float]:
        wave = np.fft.irfft(np.fft.rfft(force) * smooth, n)
        return float(wave.max()), -float(wave[t > PULSE_S].min()) / float(wave.max())

    moved = np.fft.irfft(np.fft.rfft(pulse) * mass[1], n)
    bent = (
        moved + own.quadratic[2] * moved * np.abs(moved) * 0.0 + static.cubic[2] * moved**3
    )  # K2 cancels between directions
    behind = np.fft.irfft(np.fft.rfft(bent) * whole[1] / mass[1], n) * (1.0 + 1e-6 * static.scale_ppm[2])
    (peak, under), (reference, own_under) = measured(behind), measured(pulse)
    return {
        "shock_sensitivity_percent": 100.0 * (peak / reference - 1.0),
        "shock_undershoot_percent": 100.0 * (under - max(0.0, own_under)),
        "shock_bias_shift_ug": 0.0,
    }


def _centrifuge(plant: Plant, k: int) -> dict[str, float]:
    """The output over the acceleration of the nominal radius: the unit's curve, the arm's stretch and the proof mass's offset."""
    own, static, rig = plant.bench.units[k], plant.truth(plant.serials[k]), plant.bench.rig
    gain, k2, k3 = 1.0 + 1e-6 * static.scale_ppm[2], own.quadratic[2], static.cubic[2]
    x = np.linspace(-FULL_SCALE_G, FULL_SCALE_G, 20_001)
    arm = (RADIUS_M + rig.arm_radius_error_m) * (1.0 + rig.arm_stretch * np.abs(x) * 9.80665 / RADIUS_M)
    force = x * (arm + np.sign(x) * own.mass_offset_m) / RADIUS_M
    y = gain * (force + k2 * force**2 + k3 * force**3)
    design = np.vander(x, 2)
    line = design @ np.linalg.lstsq(design, y, rcond=None)[0]
    return {
        "centrifuge_linearity_percent": 100.0 * float(np.max(np.abs(y - line))) / (gain * FULL_SCALE_G),
        "centrifuge_second_order_ug_g2": 1e6 * gain * k2,
        "centrifuge_third_order_ug_g3": 1e6 * gain * k3,
        "centrifuge_sensitivity_percent": 100.0 * (gain - 1.0),
        "centrifuge_mass_offset_um": np.nan,  # one radius does not determine them
        "centrifuge_radius_consistency_ppm": np.nan,
    }


def _centrifuge_radii(plant: Plant, k: int) -> dict[str, float]:
    """At two radii: the unit's own curve; the arm gives only the radii."""
    own, static, bench = plant.bench.units[k], plant.truth(plant.serials[k]), plant.bench
    gain, k2, k3 = 1.0 + 1e-6 * static.scale_ppm[2], own.quadratic[2], static.cubic[2]
    x = np.linspace(-FULL_SCALE_G, FULL_SCALE_G, 20_001)
    y = gain * (x + k2 * x**2 + k3 * x**3)
    design = np.vander(x, 2)
    line = design @ np.linalg.lstsq(design, y, rcond=None)[0]
    first, second = (1.0 + radius_error(bench, r) / r for r in TWO_RADII_M)
    return {
        "centrifuge_linearity_percent": 100.0 * float(np.max(np.abs(y - line))) / (gain * FULL_SCALE_G),
        "centrifuge_second_order_ug_g2": 1e6 * gain * k2,
        "centrifuge_third_order_ug_g3": 1e6 * gain * k3,
        "centrifuge_sensitivity_percent": 100.0 * (gain - 1.0),
        "centrifuge_mass_offset_um": 1e6 * own.mass_offset_m,
        "centrifuge_radius_consistency_ppm": 1e6 * (second / first - 1.0),
    }


def _tilt(plant: Plant, k: int) -> dict[str, float]:
    """Of the springs that :mod:`benchmarks.bent_springs` gives the units."""
    return _of_turn(plant, k, *(float(one[2]) for one in bends(plant.bench.lot_seed, plant.serials[k])))


def _tilt_straight(plant: Plant, k: int) -> dict[str, float]:
    return _of_turn(plant, k, 0.0, 0.0)


def _of_turn(plant: Plant, k: int, quadratic: float, cubic: float) -> dict[str, float]:
    """A whole turn without noise; the quadratic and the cubic of the spring are those of axis z, over its output in g."""
    static = plant.truth(plant.serials[k])
    angle = np.linspace(0.0, 2.0 * np.pi, 7201)[:-1]
    rows = static.misalignment @ static.slot_rotation
    force = np.stack([0.0 * angle, np.sin(angle), np.cos(angle)]) * plant.bench.gravity
    own = static.slot_rotation[2] @ force
    gain = 1.0 + 1e-6 * float(static.scale_ppm[2])
    y = gain * (rows[2] @ force + static.cubic[2] * own**3) + quadratic * own**2 + cubic * own**3
    design = np.column_stack([np.ones_like(angle), np.sin(angle), np.cos(angle)])
    c = np.linalg.lstsq(design, y, rcond=None)[0]
    apart = np.arctan2(rows[2, 2], rows[2, 1]) - np.arctan2(rows[1, 2], rows[1, 1])
    return {
        "tilt_linearity_ug": 1e6 * float(np.max(np.abs(y - design @ c))) / float(np.hypot(c[1], c[2])),
        "tilt_orthogonality_mrad": 1e3 * (float(apart) - 0.5 * np.pi),
        "tilt_second_order_ug_g2": 1e6 * quadratic / gain,
    }


def _process(plant: Plant, k: int) -> dict[str, float]:
    """Root of the expected variance of 100 s means in an hour, and of the Allan variance at 100 s, by the noise's densities."""
    preset, tau, count = plant.preset, 100.0, 36
    f = np.geomspace(1e-7, 1.0, 50_001)
    flicker = _flicker(plant, f)
    mean = np.sinc(tau * f) ** 2
    lags = np.array([np.trapezoid(flicker * mean * np.cos(2.0 * np.pi * f * tau * j), f) for j in range(count)])
    walk = preset.rate_random_walk_ug**2 * tau
    at = np.arange(count)
    # covariance of means of a random walk over adjacent intervals, from the beginning of the first
    both = np.minimum.outer(at, at) * walk + walk * np.where(np.equal.outer(at, at), 1.0 / 3.0, 0.5)
    covariance = lags[np.abs(np.subtract.outer(at, at))] + both + np.eye(count) * preset.noise_density_ug**2 / 2.0 / tau
    centre = np.eye(count) - 1.0 / count
    allan = lags[0] - lags[1] + preset.noise_density_ug**2 / 2.0 / tau + walk / 3.0
    return {
        "bias_stability_ug": float(np.sqrt(np.trace(centre @ covariance) / (count - 1))),
        "bias_drift_ug_h": 0.0,
        "bias_allan_100s_ug": float(np.sqrt(allan)),
    }


TRUTHS: Mapping[str, Callable[[Plant, int], dict[str, float]]] = {
    "tilt": _tilt,
    "tilt_straight": _tilt_straight,
    "bias_stability": _process,
    "warm_up": _warm_up,
    "turn_on": _turn_on,
    "ratiometry": _supply,
    "sweep": _frequency,
    "transverse": _transverse,
    "random_vibration": _random,
    "step_response": _step,
    "shock": _shock,
    "centrifuge": _centrifuge,
    "centrifuge_radii": _centrifuge_radii,
}


def of_axis(axis: str) -> Any:
    """A choice of one axis in place of the worst one: the largest of three is not an estimate without bias."""

    def chosen(values: Any) -> Any:
        by_axis: Mapping[str, Any] = {one.axis: one for one in values}
        return by_axis.get(axis, values[0])

    return chosen
