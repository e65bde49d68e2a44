"""Physics that is in no catalogue, each with the driver that gives it away."""

from __future__ import annotations

import numpy as np

from .physics import Draw, Floats, Physics, Table, hidden, signal
from .scene import Scene

FORCE = ("force_x", "force_y", "force_z", "force", "pose", "output_code", "out_x", "out_y", "out_z", "output")
WARMTH = ("unit_C", "temperature", "chamber_C", "theta")
CLOCK = ("time_s", "time", "since_power_s")
TABLE = ("outer_deg", "inner_deg", "outer", "inner", "pose", "force_x", "force_y", "force_z", "force")


@hidden("withheld:tide")
def _tide(draw: Draw) -> Physics:
    """The building's day: an offset that swings with the clock, several times in a run."""
    span = float(draw.scene.middle[-1] - draw.scene.middle[0])
    period, phase = span / draw.rng.uniform(2.5, 4.5), draw.rng.uniform(0.0, 2.0 * np.pi)
    size = draw.each(3)[:, None, :]

    def act(scene: Scene, _force: Floats) -> Floats:
        return size * np.sin(2.0 * np.pi * scene.middle / period + phase)[:, None]

    return signal("withheld:tide", 10e3, act, drivers=CLOCK, parameters={"period_s": float(period)})


@hidden("withheld:touch")
def _touch(draw: Draw) -> Physics:
    """Something touches the proof mass around one load only."""
    at, width = draw.rng.uniform(-0.6, 0.6), draw.rng.uniform(0.10, 0.2)
    size = draw.each(3)[:, None, :]

    def act(_scene: Scene, force: Floats) -> Floats:
        return size / np.cosh((force - at) / width) ** 2

    return signal("withheld:touch", 10e3, act, drivers=FORCE, parameters={"at_g": float(at)})


@hidden("withheld:frost")
def _frost(draw: Draw) -> Physics:
    """Moisture freezes and thaws: an offset inside a band of temperature, none outside."""
    low, high = np.percentile(draw.scene.temperature, [30.0, 70.0])
    size = draw.each(3)[:, None, :]

    def act(scene: Scene, _force: Floats) -> Floats:
        warm = scene.temperature[..., None]
        return size * (np.tanh((warm - low) / 3.0) - np.tanh((warm - high) / 3.0)) / 2.0

    return signal("withheld:frost", 10e3, act, drivers=WARMTH, parameters={"low_C": float(low), "high_C": float(high)})


@hidden("withheld:ringing")
def _ringing(draw: Draw) -> Physics:
    """The table rings slowly after each move, whatever the move."""
    period, decay = draw.rng.uniform(25.0, 50.0), draw.rng.uniform(60.0, 120.0)
    size = draw.each(3)[:, None, :]

    def act(scene: Scene, _force: Floats) -> Floats:
        since = scene.timeline.wait + scene.timeline.dwell / 2.0
        return size * (np.exp(-since / decay) * np.cos(2.0 * np.pi * since / period))[:, None]

    return signal("withheld:ringing", 50e3, act, drivers=("since_move_s", "since_move"))


@hidden("withheld:brownout")
def _brownout(draw: Draw) -> Physics:
    """The regulator loses its grip on either side of its best point."""
    size = draw.each(3)[:, None, :]

    def act(scene: Scene, _force: Floats) -> Floats:
        change = (scene.supply - 3.3) / 0.005
        return size * (change**2 / (1.0 + 0.2 * change**2))[:, None]

    return signal("withheld:brownout", 10e3, act, drivers=("supply_V", "supply"))


@hidden("withheld:rattle")
def _rattle(draw: Draw) -> Physics:
    """Something loose rattles, but only when the vibration is strong."""
    at = float(np.percentile(draw.scene.vibration, 70.0))
    size = draw.each(3)[:, None, :]

    def act(scene: Scene, _force: Floats) -> Floats:
        return size * np.tanh(np.maximum(scene.vibration - at, 0.0) / (0.15 * at))[:, None]

    return signal("withheld:rattle", 10e3, act, drivers=("vibration_g", "vibration"))


@hidden("withheld:bearing")
def _bearing(draw: Draw) -> Physics:
    """A dented ball in the outer bearing tips the table near one outer angle."""
    at, width = draw.rng.uniform(40.0, 140.0), draw.rng.uniform(15.0, 25.0)

    def act(scene: Scene, table: Table, amplitude: float) -> None:
        off = (np.degrees(scene.outer) - at + 180.0) % 360.0 - 180.0
        table.inner = table.inner + amplitude * np.exp(-0.5 * (off / width) ** 2)

    return Physics("withheld:bearing", "station", 5e3, table=act, drivers=TABLE, parameters={"at_deg": float(at)})
