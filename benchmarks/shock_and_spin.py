"""``python -m benchmarks.shock_and_spin [shock|centrifuge|two_radii|all] [n] [seed]``: hidden effects named.

Of each kind n waveforms (or runs of a centrifuge) have a hidden effect that leaves twice the floor in the judged model, and n
have none. Printed is in how many the effect is in a named class, and in how many of the others something is named; at two radii,
whose errors are drawn, also how often the effect is alone in its class. The truth is made by scipy at 200 kHz and by mechanics,
not by the product's effects.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import signal

from inertial.dynamics.centrifuge_diagnosis import DEFAULT as SPIN_MODEL
from inertial.dynamics.centrifuge_diagnosis import diagnose_spins, fit_spins
from inertial.dynamics.centrifuge_effects import Spins
from inertial.dynamics.shock_diagnosis import DEFAULT as SHOCK_MODEL
from inertial.dynamics.shock_diagnosis import ShockRecord, Waves, diagnose_shock, fit_shock

Array = np.ndarray[Any, np.dtype[np.float64]]
LOOKED_FOR = 2.0  # rms weighted residual that the hidden effect leaves in the judged model: twice the floor
NEAR = 0.03  # of it: where the search ends
FINE = 200e3
DURATION, RATE, BEFORE, AFTER = 0.011, 40 / 0.011, 0.015, 0.08
WAVE_FLOOR, PEAK = 0.02, 30.0  # g
SPIN_FLOOR = 2e-5  # g
RADIUS_ERROR = 20e-6  # m
TWO_RADII = (0.5, 0.3)  # m
G = 9.80665
LATE = 120e-6  # delay of the unit's channel

SHOCKS = (
    *("filter_of_unit", "filter_of_reference", "ac_coupled_reference", "zero_shift", "second_order"),
    *("third_order", "mounting_resonance", "own_clock", "delay"),
)
SPINS = (
    *("arm_stretch", "odd_quadratic", "mass_offset", "asymmetry", "scale_drift"),
    *("bias_drift", "hysteresis", "second_order", "third_order"),
)


def shocks(kind: str, knob: float, drawn: Array, noise: Array | None) -> ShockRecord:
    """A shock in each direction whose unit has a hidden effect, and noise (2, n) on the samples of the comparison.

    Parameters
    ----------
    drawn : (2, 2), standard normal numbers of peak and duration of each shock
    """
    time = np.arange(round((BEFORE + DURATION + AFTER) * FINE)) / FINE - BEFORE
    waves: list[Waves] = []
    for k, sign in enumerate((1.0, -1.0)):
        peak, length = PEAK * (1.0 + 0.05 * drawn[k, 0]), DURATION * (1.0 + 0.03 * drawn[k, 1])
        pulse = np.where((time > 0) & (time < length), sign * peak * np.sin(np.pi * time / length), 0.0)
        true = _low_pass(pulse, 6.0 / DURATION)
        unit, reference = _changed(kind, knob, true, time, length)
        at = np.arange(time[0] + 1e-3, time[-1] - 1e-3, 1.0 / RATE)
        late = 1e-6 * knob if kind == "delay" else LATE
        turn = 1e-4 * knob if kind == "own_clock" else 0.0
        own = np.interp(at * (1.0 + turn) - late, time, unit)
        extra = 0.0 if noise is None else noise[k, : at.size]
        waves.append(Waves(np.interp(at, time, reference), own + WAVE_FLOOR * extra, np.full(at.size, WAVE_FLOOR)))
    return ShockRecord(RATE, DURATION, BEFORE - 1e-3, tuple(waves))


def _low_pass(wave: Array, corner: float) -> Array:
    return _filtered(signal.butter(2, corner, fs=FINE), wave)


def _filtered(system: Any, wave: Array) -> Array:
    """A wave through a filter of the coefficients b and a."""
    return np.asarray(signal.lfilter(np.ravel(system[0]), system[1], wave), dtype=np.float64)


def _changed(kind: str, knob: float, true: Array, time: Array, length: float) -> tuple[Array, Array]:  # noqa: PLR0911 - one a kind
    """Waveforms of unit and reference at 200 kHz with an effect."""
    if kind == "filter_of_unit":
        return _low_pass(true, min(0.45 * FINE, 1000.0 / knob)), true
    if kind == "filter_of_reference":
        return true, _low_pass(true, min(0.45 * FINE, 1000.0 / knob))
    if kind == "ac_coupled_reference":
        return true, _filtered(signal.butter(1, knob / (2.0 * np.pi), btype="high", fs=FINE), true)
    if kind == "zero_shift":
        return true + 0.01 * knob * (time > 0.5 * length), true
    if kind == "second_order":
        return true + 1e-5 * knob * true**2, true
    if kind == "third_order":
        return true + 1e-6 * knob * true**3, true
    if kind == "mounting_resonance":
        w = 2.0 * np.pi * min(0.2 * FINE, 2000.0 / knob)
        system = signal.cont2discrete(([0.06 / w, 1.0], [1.0 / w**2, 0.06 / w, 1.0]), 1.0 / FINE, method="foh")
        return _filtered(system, true), true
    return true, true


def spin_points(radii: tuple[float, ...] = (0.5,)) -> Spins:
    """Speeds up and down again, with the units mounted one way and reversed, at each radius."""
    forces = (1.0, 3.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0)
    way = np.array([*forces, *forces[-2::-1]])
    a = np.tile(np.concatenate([way, -way]), len(radii))
    slow = np.tile(np.arange(way.size) >= len(forces), 2 * len(radii)).astype(float)
    radius = np.repeat(np.array(radii), 2 * way.size)
    return Spins(a, radius, np.linspace(0.0, 1.0, a.size), slow, RADIUS_ERROR)


def spun(points: Spins, kind: str, knob: float, holes: dict[float, float] | None = None) -> Array:
    """Output in g by mechanics: the rate is set for the nominal radius, the proof mass sits elsewhere, the spring bends.

    Parameters
    ----------
    holes : error of each radius, m; 0 where not given
    """
    sign, rate2 = np.sign(points.acceleration), np.abs(points.acceleration) * G / points.radius_m
    radius = points.radius_m + np.array([(holes or {}).get(float(r), 0.0) for r in points.radius_m])
    if kind == "arm_stretch":
        radius = radius * (1.0 + 1e-8 * knob * rate2)
    if kind == "mass_offset":
        radius = radius + sign * 1e-6 * knob
    a = sign * radius * rate2 / G
    out = 2e-3 + 1.0004 * a
    if kind != "second_order":
        out = out + 2e-6 * a**2
    if kind != "third_order":
        out = out + 5e-8 * a**3
    by_hand = {
        "odd_quadratic": 1e-7 * a * np.abs(a), "asymmetry": 1e-6 * np.abs(a), "scale_drift": 1e-6 * points.order * a,
        "bias_drift": 1e-5 * points.order, "hysteresis": 1e-6 * points.slowing * a, "second_order": 1e-7 * a**2,
        "third_order": 1e-9 * a**3,
    }  # fmt: skip
    return np.asarray(out + knob * by_hand.get(kind, 0.0 * a))


def twice_the_floor(left: Callable[[float], float]) -> float:
    """The knob at which the judged model leaves twice the floor: steps on a double logarithmic scale, then bisection.

    Parameters
    ----------
    left : rms weighted residual without noise for a knob
    """
    low, high = 1e-4, 1e4
    knob = 1.0
    for _ in range(30):
        remainder = left(knob)
        if abs(remainder / LOOKED_FOR - 1.0) < NEAR:
            break
        low, high = (max(low, knob), high) if remainder < LOOKED_FOR else (low, min(high, knob))
        step = knob * LOOKED_FOR / max(remainder, 1e-9)
        knob = step if low < step < high else float(np.sqrt(low * high))
    return knob


def shock_classes(k: int, seed: int, kind: str | None = None) -> list[tuple[str, ...]]:
    """What is named in the shock of number k: with a hidden effect of this kind, or with none."""
    rng = np.random.default_rng([seed, 2 if kind is None else 1, k])
    drawn, noise = rng.normal(size=(2, 2)), rng.normal(size=(2, 1000))
    if kind is None:
        return [one.effects for one in diagnose_shock(shocks("none", 0.0, drawn, noise)).classes]
    model: tuple[str, ...] = () if kind == "delay" else tuple(SHOCK_MODEL)

    def left(knob: float) -> float:
        fit = fit_shock(shocks(kind, knob, drawn, None), model)
        return float(np.sqrt(np.mean(np.concatenate(fit.residuals) ** 2)) / WAVE_FLOOR)

    return [one.effects for one in diagnose_shock(shocks(kind, twice_the_floor(left), drawn, noise), model).classes]


def spin_classes(
    k: int, seed: int, kind: str | None = None, radii: tuple[float, ...] = (0.5,)
) -> list[tuple[str, ...]]:
    """What is named in the run of number k of a centrifuge: with a hidden effect of this kind, or with none."""
    rng, points = np.random.default_rng([seed, 4 if kind is None else 3, k]), spin_points(radii)
    error = np.full(points.order.size, SPIN_FLOOR)
    drawn = {r: RADIUS_ERROR * float(rng.normal()) for r in radii} if len(radii) > 1 else {}
    noise = SPIN_FLOOR * rng.normal(size=error.size)
    if kind is None:
        return [one.effects for one in diagnose_spins(points, spun(points, "none", 0.0, drawn) + noise, error).classes]
    model = tuple(name for name in SPIN_MODEL if name != kind)

    def left(knob: float) -> float:
        fit = fit_spins(points, spun(points, kind, knob), error, model)
        return float(np.sqrt(np.mean((fit.residuals / error) ** 2)))

    output = spun(points, kind, twice_the_floor(left), drawn) + noise
    return [one.effects for one in diagnose_spins(points, output, error, model).classes]


def shock(n: int, seed: int) -> None:
    """Shocks with a hidden effect, and without."""
    hits: dict[str, list[bool]] = {kind: [] for kind in SHOCKS}
    for k in range(n):
        kind = SHOCKS[k % len(SHOCKS)]
        _count(hits, kind, shock_classes(k, seed, kind), k, n)
    _print("shock", hits, n)
    named = sum(bool(shock_classes(k, seed)) for k in range(n))
    print(f"shock: something is named in {named} of {n} without a hidden effect", flush=True)


def centrifuge(n: int, seed: int, radii: tuple[float, ...] = (0.5,)) -> None:
    """Runs of a centrifuge with a hidden effect, and without."""
    test = "centrifuge" if len(radii) == 1 else "two radii"
    hits = {kind: list[bool]() for kind in SPINS}
    alone = dict.fromkeys(SPINS, 0)
    for k in range(n):
        kind = SPINS[k % len(SPINS)]
        classes = spin_classes(k, seed, kind, radii)
        _count(hits, kind, classes, k, n)
        alone[kind] += (kind,) in classes
    _print(test, hits, n)
    print(f"{test}: alone in its class: {', '.join(f'{kind} {count}' for kind, count in alone.items())}", flush=True)
    named = sum(bool(spin_classes(k, seed, None, radii)) for k in range(n))
    print(f"{test}: something is named in {named} of {n} without a hidden effect", flush=True)


def two_radii(n: int, seed: int) -> None:
    """Runs at two radii."""
    centrifuge(n, seed, TWO_RADII)


def _count(hits: dict[str, list[bool]], kind: str, classes: list[tuple[str, ...]], k: int, n: int) -> None:
    hits[kind].append(any(kind in one for one in classes))
    if not hits[kind][-1]:
        print(f"  {k + 1} of {n}, missed {kind}: {classes}", flush=True)


def _print(test: str, hits: dict[str, list[bool]], n: int) -> None:
    whole = sum(map(sum, hits.values()))
    by_kind = ", ".join(f"{kind} {sum(one)}/{len(one)}" for kind, one in hits.items())
    print(f"{test}: hidden effects named in a class: {whole} of {n}; {by_kind}", flush=True)


def main() -> None:
    """All, or the one that is named."""
    what = sys.argv[1] if len(sys.argv) > 1 else "all"
    n, seed = (int(sys.argv[k]) if len(sys.argv) > k else other for k, other in ((2, 100), (3, 2026)))
    for name, run in (("shock", shock), ("centrifuge", centrifuge), ("two_radii", two_radii)):
        if what in {"all", name}:
            run(n, seed)


if __name__ == "__main__":
    main()
