"""What temperature does beyond the starting model."""

from __future__ import annotations

import numpy as np
from scipy.special import erf

from .memory import lag, play, preisach
from .physics import Draw, Floats, Physics, hidden, signal
from .scene import Scene
from .timeline import GRID_S, OFF_S

REFERENCE_C = 25.0
COARSE = 6  # hysteresis is followed every 30 s


def _warmth(scene: Scene) -> Floats:
    return (scene.temperature - REFERENCE_C)[..., None]


def _curve(effect: str, order: int, cap_ug: float) -> None:
    @hidden(effect)
    def make(draw: Draw) -> Physics:
        curve = draw.each(3)[:, None, :]
        return signal(effect, cap_ug, lambda scene, _force: curve * _warmth(scene) ** order)


for _effect, _order, _cap in (
    ("bias_temperature", 1, 3e3),
    ("bias_temperature_quadratic", 2, 3.0),
    ("bias_temperature_cubic", 3, 0.05),
):
    _curve(_effect, _order, _cap)


def _gain_curve(effect: str, order: int, power: int, cap_ug: float) -> None:
    @hidden(effect)
    def make(draw: Draw) -> Physics:
        curve = draw.each(3)[:, None, :]
        return signal(effect, cap_ug, lambda scene, force: curve * _warmth(scene) ** order * force**power)


for _effect, _order, _power, _cap in (
    ("scale_temperature", 1, 1, 1e3),
    ("scale_temperature_quadratic", 2, 1, 3.0),
    ("second_order_temperature", 1, 2, 20.0),
):
    _gain_curve(_effect, _order, _power, _cap)


@hidden("misalignment_temperature")
def _warping(draw: Draw) -> Physics:
    """The package warps: each sensing axis leans as it warms."""
    lean = draw.each(3, 3)
    lean[:, range(3), range(3)] = 0.0
    return signal(
        "misalignment_temperature", 20.0, lambda scene, force: _warmth(scene) * np.einsum("uij,unj->uni", lean, force)
    )


@hidden("thermal_rate")
def _gradient(draw: Draw) -> Physics:
    """Heat flowing through the die: output in proportion to the temperature's rate, K/min."""
    size = draw.each(3)[:, None, :]

    def act(scene: Scene, _force: Floats) -> Floats:
        rate = np.gradient(scene.die, GRID_S, axis=-1) * 60.0
        return size * scene.over_dwell(rate)[..., None]

    return signal("thermal_rate", 500.0, act)


@hidden("thermal_lag")
def _lag(draw: Draw) -> Physics:
    """The sensing element follows the die's thermometer late; its tempco may itself drift with temperature."""
    tau, size = draw.log(20.0, 300.0), draw.each(3)[:, None, :]
    bend = float(draw.rng.choice([0.0, 0.004]))

    def act(scene: Scene, _force: Floats) -> Floats:
        late = lag(scene.die, tau, GRID_S) - scene.die
        return size * scene.over_dwell(late * (1.0 + bend * (scene.die - REFERENCE_C)))[..., None]

    return signal("thermal_lag", 500.0, act, parameters={"tau_s": tau}, variant="bent" if bend else "straight")


@hidden("thermal_hysteresis")
def _hysteresis(draw: Draw) -> Physics:
    """Die attach and package creep past each other: relays (Preisach) or play of the temperature."""
    size = draw.each(3)[:, None, :]
    relays = bool(draw.rng.random() < 0.5)
    reach = draw.rng.uniform(0.1, 0.3)

    def act(scene: Scene, _force: Floats) -> Floats:
        course = scene.die[:, ::COARSE]
        low, high = float(scene.die.min()), float(scene.die.max())
        if relays:
            memory = preisach(course, low - 2.0, high + 2.0)
        else:
            memory = (play(course, reach * (high - low)) - course) / (high - low)
        fine = np.repeat(memory, COARSE, axis=1)[:, : scene.grid.size]
        return size * scene.over_dwell(fine)[..., None]

    return signal(
        "thermal_hysteresis", 10e3, act, variant="preisach" if relays else "play", parameters={"reach": float(reach)}
    )


@hidden("thermal_kink")
def _kink(draw: Draw) -> Physics:
    """A glass transition: the tempco passes from one value to another around Tc."""
    low, high = np.percentile(draw.scene.temperature, [25.0, 75.0])
    corner, width = float(draw.rng.uniform(low, high)), draw.log(2.0, 8.0)
    size = draw.each(3)[:, None, :]
    at = corner + 0.5 * draw.rng.standard_normal(draw.units)[:, None, None]

    def act(scene: Scene, _force: Floats) -> Floats:
        over = (scene.temperature[..., None] - at) / width
        return size * width * (over * (1.0 + erf(over)) / 2.0 + np.exp(-(over**2)) / (2.0 * np.sqrt(np.pi)))

    return signal("thermal_kink", 100.0, act, parameters={"corner_C": corner, "width_K": width})


@hidden("warm_up")
def _warm_up(draw: Draw) -> Physics:
    """Electronics that warm towards equilibrium after switching on, and cool while off."""
    span = float(draw.scene.middle[-1] - draw.scene.middle[0])
    tau = draw.log(60.0, max(120.0, min(OFF_S[0] / 3.0, span / 3.0)))
    each, size = draw.near(tau, 0.05), draw.each(3)[:, None, :]

    def act(scene: Scene, _force: Floats) -> Floats:
        line = scene.timeline
        cold = np.ones(draw.units)
        out = np.empty((draw.units, scene.grid.size))
        begins = np.append(line.power_on, np.inf)
        for k, begin in enumerate(line.power_on):
            cold = 1.0 - (1.0 - cold) * np.exp(-line.power_gap[k] / each)
            on = (scene.grid >= begin) & (scene.grid < begins[k + 1])
            running = scene.grid[on] - begin
            out[:, on] = cold[:, None] * np.exp(-running / each[:, None])
            stop = begins[k + 1] - (line.power_gap[k + 1] if k + 1 < len(line.power_gap) else 0.0)
            cold = cold * np.exp(-(stop - begin) / each)
        return size * scene.over_dwell(out)[..., None]

    return signal("warm_up", 20e3, act, parameters={"tau_s": tau})
