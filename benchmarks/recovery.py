"""Recovery of known truth: `python benchmarks/recovery.py --units 200`.

Units are drawn from the physics of the plant (presets, transfer, noise, converter), and their dwells are averaged as in the
chain, without the station. Output for each preset: pulls (estimate - truth)/sigma of every coefficient for three methods of
stating sigma, and the error of the output before and after calibration in verification poses.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from inertial import poses  # noqa: E402
from inertial.fits.linear import fit_lot  # noqa: E402
from inertial.fits.wander import fit_lot_with_wander  # noqa: E402
from inertial.frames import force_from_angles  # noqa: E402
from inertial.state import State  # noqa: E402
from stations.plant.device import PlantDevices, Truth, draw_truth, rotation, stream  # noqa: E402
from stations.plant.noise import UnitNoise  # noqa: E402
from stations.plant.preset import Preset, load_preset, preset_names  # noqa: E402

Array = np.ndarray
EFFECTS = (
    "bias", "scale", "misalignment", "bias_temperature", "bias_temperature_quadratic", "scale_temperature",
    "scale_temperature_quadratic", "third_order",
)  # fmt: skip
TEMPERATURES = (-20.0, 25.0, 60.0)
RATE, DWELL_S, MOVE_S, SOAK_S = 100.0, 10.0, 20.0, 1800.0
CHUNK = 25
NOTES = {"ADXL355": (1.20, 0.35), "SF1500": (0.80, 0.20), "QA700": (0.30, 0.05)}


@dataclass(frozen=True)
class Measured:
    """Dwells of a lot: fit poses at every temperature, then poses for verification at each."""

    state: State
    fresh: State
    output: Array
    fresh_output: Array
    error: Array
    truths: list[Truth]
    preset: Preset


def plan(rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Force, temperature, time and use for verification of every dwell in order."""
    fit, check = np.radians(poses.plan("fibonacci24")), np.radians(rng.uniform(-180.0, 180.0, (6, 2)))
    angles = np.tile(np.concatenate([fit, check]), (len(TEMPERATURES), 1))
    force = force_from_angles(angles[:, 0], angles[:, 1])
    heat = np.repeat(TEMPERATURES, len(fit) + len(check))
    fresh = np.tile(np.arange(len(fit) + len(check)) >= len(fit), len(TEMPERATURES))
    number = np.arange(len(heat))
    start = number * (DWELL_S + MOVE_S) + number // (len(fit) + len(check)) * SOAK_S
    return force, heat, start, fresh


def measured(preset: Preset, units: int, seed: int) -> Measured:
    """Dwell means of `units` devices."""
    rng = np.random.default_rng(seed)
    force, heat, start, fresh = plan(rng)
    truths = [
        draw_truth(
            preset,
            f"R{k:04d}",
            seed,
            slot_rotation=rotation(1e-3 * stream(seed, f"R{k:04d}", "slot").standard_normal(3)),
            supply_ratio=1.0,
            output_scale=preset.scale,
        )
        for k in range(units)
    ]
    parts = [chunk(preset, truths[k : k + CHUNK], seed, (force, heat, start)) for k in range(0, units, CHUNK)]
    mean, sd = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    n = round(RATE * DWELL_S)
    # a constant reading has the error of its last digit, not zero
    error = np.sqrt(sd**2 / n + np.where(sd < preset.lsb, preset.lsb**2 / 12.0, 0.0))

    def state(which: Array) -> State:
        return State(force=force[which], time=start[which] + DWELL_S / 2.0, temperature=heat[which])

    return Measured(state(~fresh), state(fresh), mean[:, ~fresh], mean[:, fresh], error[:, ~fresh], truths, preset)


def chunk(preset: Preset, truths: list[Truth], seed: int, dwells: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """Means and standard deviations (units, dwells, 3) of a sample, output unit, of some units."""
    devices = PlantDevices(preset, truths)
    noise = UnitNoise(preset, [stream(seed, t.serial, "noise") for t in truths])
    n, before, means, sds = round(RATE * DWELL_S), 0.0, [], []
    lsb = float(np.float32(preset.lsb))
    for force, heat, start in zip(*dwells, strict=True):
        turned = np.stack([t.slot_rotation @ force for t in truths])[None]
        clean = devices.output(turned, np.full((1, len(truths)), heat))
        noise.jump(start - before)
        counts = devices.counts(clean + noise.sample(n, RATE)) * lsb
        before = start + DWELL_S
        means.append(counts.mean(axis=0) - preset.zero_level)
        sds.append(counts.std(axis=0, ddof=1))
    return np.stack(means, axis=1), np.stack(sds, axis=1)


def truth_of(truths: list[Truth], names: tuple[tuple[tuple[str, str], ...], ...], scale: float) -> Array:
    """True coefficients (units, 3, p) from the physics of the devices, for forces in the fixture's frame."""
    out = np.zeros((len(truths), 3, len(names[0])))
    for u, truth in enumerate(truths):
        gain = 1.0 + 1e-6 * truth.scale_ppm
        matrix = gain[:, None] * (truth.misalignment @ truth.slot_rotation)
        for axis in range(3):
            across = iter(((axis + 1) % 3, (axis + 2) % 3))
            for c, (effect, _) in enumerate(names[axis]):
                value = {
                    "bias": lambda a=axis, t=truth: t.bias_g[a],
                    "scale": lambda a=axis, m=matrix: m[a, a],
                    "misalignment": lambda a=axis, m=matrix, it=across: m[a, next(it)],
                    "bias_temperature": lambda a=axis, t=truth: t.bias_tempco[a],
                    "bias_temperature_quadratic": lambda a=axis, t=truth: t.bias_tempco_quadratic[a],
                    "scale_temperature": lambda a=axis, m=matrix, t=truth: m[a, a] * t.scale_tempco[a],
                    "scale_temperature_quadratic": lambda a=axis, m=matrix, t=truth: (
                        m[a, a] * t.scale_tempco_quadratic[a]
                    ),
                    "third_order": lambda a=axis, g=gain, t=truth: g[a] * t.cubic[a],
                }[effect]()
                out[u, axis, c] = scale * value
    return out


def pulls(data: Measured) -> None:
    """Prints mean and standard deviation of the pulls for three methods of stating sigma."""
    plain = fit_lot(EFFECTS, data.state, data.output, data.error)
    wander = fit_lot_with_wander(EFFECTS, data.state, data.output, data.error)
    truth = truth_of(data.truths, plain.names, data.preset.scale)
    birge = np.sqrt(np.maximum(1.0, plain.chi2 / plain.dof))[..., None]
    ways = {
        "white sd/√n": (plain.coefficients - truth) / plain.standard_errors,
        "white × Birge ratio": (plain.coefficients - truth) / (plain.standard_errors * birge),
        "white + drift": (wander.fit.coefficients - truth) / wander.fit.standard_errors,
    }
    print(
        f"  between dwells, in standard errors sd/√n: flicker {wander.flicker:.1f}, random walk {wander.walk:.1f} at the"
        f" end, white {wander.white:.1f}"
    )
    for name, values in ways.items():
        flat = np.moveaxis(values, 2, 0).reshape(values.shape[2], -1)
        mean, sd = flat.mean(axis=1), flat.std(axis=1)
        good = (np.abs(mean) <= 0.15) & (np.abs(sd - 1.0) <= 0.1)
        print(f"  {name:<20} mean {mean.min():+.2f} … {mean.max():+.2f}, sd {sd.min():.2f} … {sd.max():.2f};"
              f" {good.sum()} of {good.size} coefficients within 0 ± 0.15 and 0.9 … 1.1")  # fmt: skip
        for c in np.flatnonzero(~good) if name.startswith("white +") else ():
            print(f"      {plain.names[0][c][0]}: mean {mean[c]:+.2f}, sd {sd[c]:.2f}")


def errors(data: Measured) -> None:
    """Prints the error of the output on verification poses before and after calibration, mg rms."""
    from inertial.correction import correct

    scale, fresh = data.preset.scale, data.fresh
    reference = np.broadcast_to(fresh.force, data.fresh_output.shape)
    before = data.fresh_output / scale - reference
    base = EFFECTS[:7]
    fit = fit_lot_with_wander(base, data.state, data.output, data.error).fit
    after = correct(base, fresh, data.fresh_output, fit.coefficients, fit.nonlinear) - reference
    best = fit_lot(EFFECTS, data.state, data.output, data.error)
    truth = truth_of(data.truths, best.names, scale)
    floor = correct(EFFECTS, fresh, data.fresh_output, truth, best.nonlinear) - reference
    turned_on = before - before.mean(axis=(0, 1))
    notes = NOTES.get(data.preset.name)
    beside = f"published {notes[0]:.2f} → {notes[1]:.2f} mg" if notes else "not published"
    print(
        f"  error on verification poses {rms(before):.3f} → {rms(after):.4f} mg rms ({beside}); "
        f"before, without the mean of the type {rms(turned_on):.3f}; with the true coefficients {rms(floor):.4f} mg remain"
    )


WHY = """Differences from the published values. Before: the simulated units have the turn-on offset, sensitivity error,
misalignment and slot rotation of the presets (ADXL355: 8 mg, 0.3 %, 3 mrad, 1 mrad, one sigma); the content of the
published "before" is not known. After: the error with the true coefficients is printed too, so the remainder is drift
of the output during the run (bias instability, random walk), which coefficients cannot correct; the time span of the
published value is not known."""


def rms(values: Array) -> float:
    """Root mean square in mg."""
    return 1e3 * float(np.sqrt(np.mean(values**2)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--preset", choices=preset_names(), action="append")
    options = parser.parse_args()
    print(f"python benchmarks/recovery.py --units {options.units} --seed {options.seed}")
    for name in options.preset or preset_names():
        start = time.perf_counter()
        data = measured(load_preset(name), options.units, options.seed)
        took = time.perf_counter() - start
        print(f"{name}: {options.units} units × {data.output.shape[1]} dwells of {DWELL_S:g} s, drawn in {took:.0f} s")
        pulls(data)
        errors(data)
    print(WHY)


if __name__ == "__main__":
    main()
