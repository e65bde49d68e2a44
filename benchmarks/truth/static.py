"""Transfer curves of the sensor and its converter."""

from __future__ import annotations

import numpy as np

from .physics import Draw, Floats, Physics, hidden, signal
from .scene import Scene

POSE_RMS = 0.4  # of a polynomial of the force over the sphere


def _poly(effect: str, order: int, cap_ug: float) -> None:
    @hidden(effect)
    def make(draw: Draw) -> Physics:
        curve = draw.each(3)[:, None, :]
        return signal(effect, cap_ug, lambda _scene, force: curve * force**order, generic=POSE_RMS)


for _effect, _order, _cap in (
    ("second_order", 2, 5e3),
    ("third_order", 3, 5e3),
    ("fourth_order", 4, 5e3),
    ("fifth_order", 5, 5e3),
):
    _poly(_effect, _order, _cap)


@hidden("scale_asymmetry")
def _two_gains(draw: Draw) -> Physics:
    """Push and pull of the loop have unlike gains."""
    gain = draw.each(3)[:, None, :]
    return signal(
        "scale_asymmetry", 5e3, lambda _scene, force: np.where(force > 0.0, gain, -gain) * force, generic=POSE_RMS
    )


@hidden("odd_quadratic")
def _odd_quadratic(draw: Draw) -> Physics:
    """Stiffening that grows with the deflection, alike to both sides."""
    curve = draw.each(3)[:, None, :]
    return signal(
        "odd_quadratic", 5e3, lambda _scene, force: np.copysign(curve * force**2, curve * force), generic=POSE_RMS
    )


@hidden("bias_asymmetry")
def _comparator(draw: Draw) -> Physics:
    """The averaged decision of a comparator dithered by a few mg of noise."""
    jump, dither = draw.each(3)[:, None, :], draw.log(1e-3, 5e-3)
    return signal(
        "bias_asymmetry",
        5e3,
        lambda _scene, force: jump * np.tanh(force / dither),
        parameters={"dither_g": dither},
        generic=POSE_RMS,
    )


@hidden("cross_coupling")
def _pendulum(draw: Draw) -> Physics:
    """A pendulous mass swings off its null under load, so that its axis leans into the two others."""
    lean = draw.each(3, 2)

    def act(_scene: Scene, force: Floats) -> Floats:
        out = np.empty_like(force)
        for axis in range(3):
            first, second = (axis + 1) % 3, (axis + 2) % 3
            for column, other in enumerate((first, second)):
                angle = lean[:, None, axis, column] * force[..., axis] * 1e-3
                swing = np.sin(angle) * force[..., other] * 1e3
                out[..., axis] = swing if column == 0 else out[..., axis] + swing
        return out

    return signal("cross_coupling", 1e3, act, generic=POSE_RMS)


@hidden("cross_axis_quadratic")
def _cross_compliance(draw: Draw) -> Physics:
    """Suspension compliance: a quadratic form of the two cross-axis loads."""
    form = draw.each(3, 3)

    def act(_scene: Scene, force: Floats) -> Floats:
        out = np.empty_like(force)
        for axis in range(3):
            pair = force[..., [(axis + 1) % 3, (axis + 2) % 3]]
            a, b, c = form[:, axis].T
            matrix = np.stack([np.stack([a, b / 2.0], -1), np.stack([b / 2.0, c], -1)], -2)
            out[..., axis] = np.einsum("unj,ujk,unk->un", pair, matrix, pair)
        return out

    return signal("cross_axis_quadratic", 5e3, act, generic=POSE_RMS)


@hidden("adc_nonlinearity")
def _converter(draw: Draw) -> Physics:
    """Periodic INL of the converter: in the code, so after bias and scale; a wave, or a triangle from uneven steps."""
    period = draw.log(0.08, 0.5)
    size, phase = draw.each(3), draw.rng.uniform(0.0, 2.0 * np.pi, 3) + 0.3 * draw.rng.standard_normal((draw.units, 3))
    triangle = bool(draw.rng.random() < 0.3)

    def act(_scene: Scene, output: Floats, amplitude: float) -> Floats:
        turn = 2.0 * np.pi * output / period + phase[:, None, :]
        wave = np.sin(turn) - (np.sin(3.0 * turn) / 9.0 if triangle else 0.0)
        return output + amplitude * size[:, None, :] * wave

    return Physics(
        "adc_nonlinearity",
        "sensor",
        20e3,
        converter=act,
        variant="triangle" if triangle else "wave",
        parameters={"period_g": period},
    )


@hidden("dead_zone")
def _friction(draw: Draw) -> Physics:
    """Friction eats the first bit of load either way; rounded at the corners."""
    width = draw.near(1.0, 0.2)[:, None, None] * np.abs(draw.each(3))[:, None, :]

    def act(_scene: Scene, force: Floats, amplitude: float) -> Floats:
        gap = amplitude * width
        corner = 0.2 * gap

        def bend(load: Floats) -> Floats:
            return corner * np.logaddexp(0.0, (load - gap) / corner)

        return bend(force) - bend(-force)

    return Physics("dead_zone", "sensor", 20e3, stress=act, generic=POSE_RMS)


@hidden("clipping")
def _stops(draw: Draw) -> Physics:
    """Mechanical stops a little short of 1 g."""
    depth = draw.near(1.0, 0.003)[:, None, None]

    def act(_scene: Scene, force: Floats, amplitude: float) -> Floats:
        stop = 1.0 - amplitude * depth
        return np.clip(force, -stop, stop)

    return Physics("clipping", "sensor", 500e3, stress=act)
