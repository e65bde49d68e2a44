"""What the station does wrong, the same for every unit: geometry of the table and of gravity."""

from __future__ import annotations

import numpy as np

from .physics import Draw, Physics, Table, hidden
from .scene import Scene

CAP_UG = 2e3


def _station(effect: str, act: object, **extra: object) -> Physics:
    return Physics(effect, "station", CAP_UG, table=act, generic=0.5, **extra)  # type: ignore[arg-type]


@hidden("level_error")
def _level(draw: Draw) -> Physics:
    """The base is not level: up leans in the laboratory."""
    bearing = draw.rng.uniform(0.0, 2.0 * np.pi)

    def act(_scene: Scene, table: Table, amplitude: float) -> None:
        lean = np.array([np.cos(bearing), np.sin(bearing), 0.0]) * amplitude
        table.up = table.up + lean

    return _station("level_error", act, parameters={"bearing_rad": float(bearing)})


@hidden("outer_encoder_offset")
def _offset(_draw: Draw) -> Physics:
    def act(_scene: Scene, table: Table, amplitude: float) -> None:
        table.outer = table.outer + amplitude

    return _station("outer_encoder_offset", act)


@hidden("encoder_harmonic")
def _harmonic(draw: Draw) -> Physics:
    """An eccentric or oval encoder scale, on either axis."""
    order, phase = int(draw.rng.integers(1, 3)), draw.rng.uniform(0.0, 2.0 * np.pi)
    inner = bool(draw.rng.random() < 0.4)

    def act(scene: Scene, table: Table, amplitude: float) -> None:
        if inner:
            table.inner = table.inner + amplitude * np.sin(order * scene.inner + phase)
        else:
            table.outer = table.outer + amplitude * np.sin(order * scene.outer + phase)

    axis = "inner" if inner else "outer"
    return _station("encoder_harmonic", act, variant=f"{axis} n={order}", parameters={"phase_rad": float(phase)})


@hidden("axis_nonorthogonality")
def _skew(_draw: Draw) -> Physics:
    def act(_scene: Scene, table: Table, amplitude: float) -> None:
        table.skew += amplitude

    return _station("axis_nonorthogonality", act)


@hidden("backlash")
def _backlash(draw: Draw) -> Physics:
    """Play in the gears: the axis lags its encoder to the side it came from, and stays there while it stands still."""
    share = draw.rng.uniform(0.3, 1.0, 2)

    def side(angle: np.ndarray) -> np.ndarray:
        move = np.diff(np.concatenate([[0.0], angle]))
        out, last = np.zeros(len(move)), 0.0
        for k, step in enumerate(move):
            last = float(np.sign(step)) if abs(step) > 1e-3 else last
            out[k] = last
        return out

    def act(scene: Scene, table: Table, amplitude: float) -> None:
        table.outer = table.outer - amplitude * share[0] * side(scene.outer)
        table.inner = table.inner - amplitude * share[1] * side(scene.inner)

    return _station("backlash", act)


@hidden("slot_rotation")
def _slots(draw: Draw) -> Physics:
    turn = 0.7 * draw.rng.standard_normal((draw.units, 3))

    def act(_scene: Scene, table: Table, amplitude: float) -> None:
        table.slot = amplitude * turn

    return Physics("slot_rotation", "slot", CAP_UG, table=act)


@hidden("gravity_value")
def _gravity(_draw: Draw) -> Physics:
    def act(_scene: Scene, table: Table, amplitude: float) -> None:
        table.gravity *= 1.0 + amplitude

    return _station("gravity_value", act)
