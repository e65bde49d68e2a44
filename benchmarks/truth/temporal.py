"""Time, mechanics, electrics and surroundings."""

from __future__ import annotations

import numpy as np

from .memory import play, relaxation
from .physics import Draw, Floats, Physics, hidden, signal
from .scene import Scene

PARKED = np.array([0.0, 0.0, 1.0])
VOLTS = 3.3


def _wear(scene: Scene) -> Floats:
    """Time since the run began as a share of an hour, averaged over each dwell, (n, 1)."""
    return (scene.middle / 3600.0)[:, None]


@hidden("aging_linear")
def _drift(draw: Draw) -> Physics:
    rate = draw.each(3, loose=bool(draw.rng.random() < 0.5))[:, None, :]
    return signal("aging_linear", 200.0, lambda scene, _force: rate * _wear(scene))


@hidden("scale_aging")
def _gain_drift(draw: Draw) -> Physics:
    rate = draw.each(3)[:, None, :]
    return signal("scale_aging", 300.0, lambda scene, force: rate * _wear(scene) * force)


@hidden("aging_log")
def _stretched(draw: Draw) -> Physics:
    """Many relaxations with time constants spread evenly over decades, all set off by switching on."""
    span = float(draw.scene.middle[-1])
    begin = draw.log(60.0, max(120.0, span / 10.0))
    times = begin * np.geomspace(0.56, 1e3, 40)
    weight = float(np.log(times[1] / times[0]))
    rate = draw.each(3)[:, None, :]

    def act(scene: Scene, _force: Floats) -> Floats:
        since = scene.since_power(scene.middle)[:, None]
        return rate * (weight * (1.0 - np.exp(-since / times)).sum(axis=1))[:, None]

    return signal("aging_log", 2e3, act, parameters={"tau_s": begin})


@hidden("step_change")
def _knock(draw: Draw) -> Physics:
    """Somebody knocks the fixture: every unit's bias jumps, each in its own way."""
    middle = draw.scene.middle
    at = float(middle[int(len(middle) * draw.rng.uniform(0.15, 0.85))] - 15.0)
    jump = draw.each(3, loose=True)[:, None, :]
    return signal(
        "step_change", 5e3, lambda scene, _force: jump * (scene.middle > at)[:, None], parameters={"at_s": at}
    )


@hidden("creep_after_move")
def _creep(draw: Draw) -> Physics:
    """A viscoelastic suspension that goes on giving after each move."""
    tau, size = draw.log(5.0, 60.0), draw.each(3)[:, None, :]
    each = draw.near(tau, 0.05)

    def act(scene: Scene, force: Floats) -> Floats:
        line = scene.timeline
        start = np.broadcast_to(PARKED, (draw.units, 3)).copy()
        stay = line.wait + line.dwell + line.stay
        return size * relaxation(force, start, line.wait, np.full(len(line.wait), line.dwell), stay, each)

    return signal("creep_after_move", 20e3, act, parameters={"tau_s": tau})


@hidden("pose_hysteresis")
def _stick(draw: Draw) -> Physics:
    """Friction in the suspension: it remembers from which side the load came; part of the units' kinds let go in between."""
    size, width = draw.each(3)[:, None, :], draw.log(0.01, 0.05)
    keeps = bool(draw.rng.random() < 0.5)

    def act(_scene: Scene, force: Floats) -> Floats:
        course = np.concatenate([np.broadcast_to(PARKED, (force.shape[0], 1, 3)), force], axis=1)
        if keeps:
            side = (course - play(course.transpose(0, 2, 1), width).transpose(0, 2, 1)) / width
            return size * side[:, 1:]
        return size * np.clip(np.diff(course, axis=1) / width, -1.0, 1.0)

    return signal("pose_hysteresis", 5e3, act, variant="keeps" if keeps else "lets go", parameters={"width_g": width})


@hidden("vibration_rectification")
def _rectification(draw: Draw) -> Physics:
    """The quadratic curve of the loop turns vibration into an offset."""
    curve = draw.each(3)[:, None, :]
    return signal("vibration_rectification", 20e3, lambda scene, _force: curve * (scene.vibration**2)[:, None])


@hidden("supply_sensitivity")
def _ratiometric(draw: Draw) -> Physics:
    """Bias and gain follow the supply."""
    gain = draw.each(3, 2)

    def act(scene: Scene, force: Floats) -> Floats:
        change = (scene.supply - VOLTS)[:, None]
        return (gain[:, None, :, 0] + gain[:, None, :, 1] * force) * change

    return signal("supply_sensitivity", 100e3, act)


@hidden("magnetic")
def _magnetic(draw: Draw) -> Physics:
    """A loop or a magnet inside feels the laboratory's field, which turns against the sensor as the table moves."""
    feel = draw.each(3, 3, loose=True)
    bearing = draw.rng.uniform(0.0, 2.0 * np.pi)
    dip = draw.rng.uniform(0.5, 1.2)
    field = np.array([np.cos(dip) * np.cos(bearing), np.cos(dip) * np.sin(bearing), -np.sin(dip)])

    def act(scene: Scene, _force: Floats) -> Floats:
        ca, sa, cb, sb = np.cos(scene.outer), np.sin(scene.outer), np.cos(scene.inner), np.sin(scene.inner)
        y, z = ca * field[1] + sa * field[2], -sa * field[1] + ca * field[2]
        seen = np.column_stack([cb * field[0] + sb * y, -sb * field[0] + cb * y, z])
        return np.einsum("uij,nj->uni", feel, seen)

    return signal("magnetic", 5e3, act)


def covariate(draw: Draw, column: str, shape: str) -> Physics:
    """Output that follows a recorded column: a straight line, or a bend (saturation, trough or threshold)."""
    record = draw.scene.covariates[column]
    centre, span = float(np.mean(record)), float(np.std(record))
    bend = str(draw.rng.choice(["trough", "saturation", "threshold"])) if shape == "curve" else "line"
    at = float(draw.rng.uniform(-0.4, 0.4))
    size = draw.each(3)[:, None, :]

    def act(scene: Scene, _force: Floats) -> Floats:
        x = (scene.covariates[column] - centre) / span
        curve = {
            "line": x,
            "trough": (x - at) ** 2,
            "saturation": np.tanh(1.5 * (x - at)),
            "threshold": np.logaddexp(0.0, 4.0 * (x - at)) / 4.0,
        }[bend]
        return size * curve[:, None]

    return signal(f"covariate:{column}", 50e3, act, variant=bend, drivers=(column,))
