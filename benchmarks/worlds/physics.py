"""Hidden physics, written from the equations in words of physics; each draws what differs from unit to unit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Floats = np.ndarray
Effect = Callable[[Any], Floats]


def _sizes(rng: np.random.Generator, units: int, count: int = 1) -> Floats:
    """Coefficients of units and axes, (units, 3, count): a part that the design makes, a part of each unit's own."""
    return rng.standard_normal((1, 3, count)) + 0.5 * rng.standard_normal((units, 3, count))


def _of_force(shape: Callable[[Floats], Floats]) -> Callable[..., Effect]:
    def draw(rng: np.random.Generator, units: int, scene: Any) -> Effect:
        size = _sizes(rng, units)[..., 0]
        return lambda s: size[:, None] * shape(s.force)[None]

    return draw


def _of_temperature(shape: Callable[[Floats, Floats], Floats]) -> Callable[..., Effect]:
    """``shape(warm (units, n, 1), force along the axes (units, n, 3))`` gives (units, n, 3)."""

    def draw(rng: np.random.Generator, units: int, scene: Any) -> Effect:
        size = _sizes(rng, units)[..., 0]
        return lambda s: size[:, None] * shape((s.temperature - 25.0)[..., None], s.along)

    return draw


def cross_coupling(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """f_i·f_j and f_i·f_k."""
    size = _sizes(rng, units, 2)

    def effect(s: Any) -> Floats:
        f = s.force
        parts = [np.stack([f[:, i] * f[:, (i + 1) % 3], f[:, i] * f[:, (i + 2) % 3]]) for i in range(3)]
        return np.stack([np.einsum("uk,kn->un", size[:, i], parts[i]) for i in range(3)], axis=-1)

    return effect


def misalignment_temperature(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """Axes that turn with temperature."""
    size = _sizes(rng, units, 2)

    def effect(s: Any) -> Floats:
        warm, f = s.temperature - 25.0, s.force
        return np.stack([
            warm * (size[:, i, :1] * f[:, (i + 1) % 3] + size[:, i, 1:] * f[:, (i + 2) % 3]) for i in range(3)
        ], axis=-1)  # fmt: skip

    return effect


def aging_linear(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """Bias that runs off at an even rate."""
    size = _sizes(rng, units)[..., 0]
    return lambda s: size[:, None] * (s.start / scene.start[-1])[None, :, None]


def warm_up(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """Bias that settles after power-on."""
    size, tau = _sizes(rng, units)[..., 0], float(np.exp(rng.uniform(np.log(900.0), np.log(3000.0))))
    return lambda s: size[:, None] * np.exp(-s.start / tau)[None, :, None]


def step_change(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """Bias that jumps once, at the same time in the lot."""
    size, at = _sizes(rng, units)[..., 0], float(rng.uniform(0.3, 0.7)) * scene.start[-1]
    return lambda s: size[:, None] * (s.start > at)[None, :, None]


def thermal_kink(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """Bias whose slope changes where an adhesive softens, over a few kelvin."""
    low, high = float(np.min(scene.temperature)), float(np.max(scene.temperature))
    size = _sizes(rng, units)[..., 0]
    place, width = low + float(rng.uniform(0.3, 0.7)) * (high - low), float(rng.uniform(1.0, 4.0))
    return lambda s: size[:, None] * (width * np.logaddexp(0.0, (s.temperature - place) / width))[..., None]


def thermal_hysteresis(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """Play between temperature and bias: the bias follows the edge of a gap of some kelvin."""
    size, half = _sizes(rng, units)[..., 0], float(rng.uniform(4.0, 12.0))

    def effect(s: Any) -> Floats:
        body, state = s.fine_temperature, np.empty_like(s.fine_temperature)
        held = body[:, 0].copy()
        for k in range(body.shape[1]):
            held = np.clip(held, body[:, k] - half, body[:, k] + half)
            state[:, k] = held - body[:, k]
        middle = s.start + 0.5 * s.duration
        own = np.stack([np.interp(middle, s.fine, one) for one in state])
        return size[:, None] * own[..., None]

    return effect


def thermal_lag(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """A bias of an element that has not yet the temperature of its thermometer; time constants within 3 % from unit to unit."""
    size = _sizes(rng, units)[..., 0]
    tau = float(np.exp(rng.uniform(np.log(60.0), np.log(300.0)))) * (1.0 + 0.03 * rng.standard_normal(units))

    def effect(s: Any) -> Floats:
        body, behind = s.fine_temperature, np.zeros_like(s.fine_temperature)
        keep, held = np.exp(-(s.fine[1] - s.fine[0]) / tau), body[:, 0].copy()
        for k in range(1, body.shape[1]):
            held = body[:, k] + (held - body[:, k]) * keep
            behind[:, k] = held - body[:, k]
        own = np.stack([np.interp(s.start + 0.5 * s.duration, s.fine, one) for one in behind])
        return size[:, None] * own[..., None]

    return effect


def thermal_rate(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """Bias of a gradient across the device, which is as large as its temperature changes fast."""
    size = _sizes(rng, units)[..., 0]

    def effect(s: Any) -> Floats:
        rate = np.gradient(s.fine_temperature, s.fine, axis=1)
        own = np.stack([np.interp(s.start + 0.5 * s.duration, s.fine, one) for one in rate])
        return size[:, None] * own[..., None]

    return effect


def level_error(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """The outer axis is not level: up leans in the laboratory, alike for all units."""
    lean = rng.standard_normal(2)

    def effect(s: Any) -> Floats:
        up = np.stack([np.full(s.outer.size, lean[0]), np.full(s.outer.size, lean[1]), np.zeros(s.outer.size)], axis=-1)
        x, y, z = up.T
        about_outer = np.stack(
            [x, np.cos(s.outer) * y + np.sin(s.outer) * z, -np.sin(s.outer) * y + np.cos(s.outer) * z]
        )
        c, d = np.cos(s.inner), np.sin(s.inner)
        fixture = np.stack(
            [c * about_outer[0] + d * about_outer[1], -d * about_outer[0] + c * about_outer[1], about_outer[2]]
        )
        return np.broadcast_to(fixture.T, (units, s.outer.size, 3))

    return effect


def creep_after_move(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """A suspension of which a part follows the force late: what is still missing of its deflection, over each dwell.

    The table turns both axes at once and is at rest for the wait before a dwell. Time constants are of the design, within 3 %
    from unit to unit.
    """
    size = _sizes(rng, units)[..., 0]
    tau = float(np.exp(rng.uniform(np.log(15.0), np.log(60.0)))) * (1.0 + 0.03 * rng.standard_normal(units))

    def effect(s: Any) -> Floats:
        strain = np.broadcast_to([0.0, 0.0, 1.0], (units, 3)).copy()
        missing = np.zeros((units, s.outer.size, 3))
        before, at = float(s.start[0]) - 60.0, (0.0, 0.0)
        for k, place in enumerate(zip(s.outer.tolist(), s.inner.tolist(), strict=True)):
            arrives, end = float(s.start[k] - s.wait[k]), float(s.start[k] + s.duration[k])
            leaves = max(arrives - max(abs(p - a) for p, a in zip(place, at, strict=True)) / SPEED, before)
            strain = _follow(strain, _direction(*at), leaves - before, tau)
            count = round((end - leaves) / _FINE_S) + 1
            step, inside = (end - leaves) / count, 0
            for middle in leaves + (np.arange(count) + 0.5) * step:
                part = min((middle - leaves) / max(arrives - leaves, 1e-9), 1.0)
                force = _direction(*(a + part * (p - a) for p, a in zip(place, at, strict=True)))
                strain = _follow(strain, force, step, tau)
                if middle > s.start[k]:
                    missing[:, k] -= force - strain
                    inside += 1
            missing[:, k] /= max(inside, 1)
            before, at = end, place
        return size[:, None] * missing

    return effect


_FINE_S = 0.5
SPEED = float(np.radians(20.0))
"""Of the table, rad/s."""


def _direction(outer: float, inner: float) -> Floats:
    return np.array([np.sin(outer) * np.sin(inner), np.sin(outer) * np.cos(inner), np.cos(outer)])


def _follow(strain: Floats, force: Floats, seconds: float, tau: Floats) -> Floats:
    """Strains (units, 3) some time later, under a force (3,) that stays."""
    return strain + (force - strain) * -np.expm1(-seconds / tau)[:, None]


def converter(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """Integral nonlinearity of a converter of equal segments: a period of the design, a phase of each part.

    What it converts is the output of the axis, with offset, misalignment and its run with temperature.
    """
    period, size = float(rng.uniform(0.15, 0.6)), 1.0 + 0.2 * rng.standard_normal((units, 1, 3))
    phase = rng.uniform(0.0, 2.0 * np.pi, (units, 1, 3))
    return lambda s: size * np.sin(2.0 * np.pi * s.output / period + phase)


def _of_scale(course: Callable[[Any], Floats]) -> Callable[..., Effect]:
    """Scale factors that follow a course in time or temperature, (units, n)."""

    def draw(rng: np.random.Generator, units: int, scene: Any) -> Effect:
        size = _sizes(rng, units)[..., 0]
        return lambda s: size[:, None] * course(s)[..., None] * s.along

    return draw


def _of_axes(course: Callable[[Any], Floats]) -> Callable[..., Effect]:
    """Axes of each unit that turn by a course in time or temperature, (units, n)."""

    def draw(rng: np.random.Generator, units: int, scene: Any) -> Effect:
        size = _sizes(rng, units, 2)

        def effect(s: Any) -> Floats:
            f, now = s.force, course(s)
            return np.stack([
                now * (size[:, i, :1] * f[:, (i + 1) % 3] + size[:, i, 1:] * f[:, (i + 2) % 3]) for i in range(3)
            ], axis=-1)  # fmt: skip

        return effect

    return draw


def fixture_bends(rng: np.random.Generator, units: int, scene: Any) -> Effect:
    """A fixture of two metals that turns all units by the square of the temperature's distance from that of its assembly."""
    way = rng.standard_normal(3)

    def effect(s: Any) -> Floats:
        bend = ((s.chamber - 25.0) / 35.0) ** 2  # (units, n)
        return bend[..., None] * np.cross(way, s.force)[None]

    return effect


def _warming(s: Any) -> Floats:
    """What is still missing after power-on, (1, n)."""
    return np.exp(-s.start / 1500.0)[None]


def _warm(s: Any) -> Floats:
    return (s.temperature - 25.0) / 35.0


OUTSIDE: dict[str, Callable[..., Effect]] = {
    "scale_warms_up": _of_scale(_warming),
    "axes_warm_up": _of_axes(_warming),
    "axes_bend_with_heat": _of_axes(lambda s: _warm(s) ** 2),
    "cubic_with_heat": _of_temperature(lambda w, f: w * f**3),
    "fixture_bends": fixture_bends,
}
"""Physics that the catalogue does not have."""

PHYSICS: dict[str, Callable[..., Effect]] = {
    "third_order": _of_force(lambda f: f**3),
    "odd_quadratic": _of_force(lambda f: f * np.abs(f)),
    "second_order": _of_force(lambda f: f**2),
    "scale_asymmetry": _of_force(np.abs),
    "cross_coupling": cross_coupling,
    "bias_temperature_quadratic": _of_temperature(lambda w, f: w**2 + 0.0 * f),
    "scale_temperature_quadratic": _of_temperature(lambda w, f: w**2 * f),
    "misalignment_temperature": misalignment_temperature,
    "aging_linear": aging_linear,
    "warm_up": warm_up,
    "step_change": step_change,
    "thermal_kink": thermal_kink,
    "thermal_hysteresis": thermal_hysteresis,
    "thermal_lag": thermal_lag,
    "thermal_rate": thermal_rate,
    "creep_after_move": creep_after_move,
    "level_error": level_error,
    "adc_nonlinearity": converter,
    **OUTSIDE,
}
