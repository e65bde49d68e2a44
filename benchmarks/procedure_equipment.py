"""``python -m benchmarks.procedure_equipment [PROCEDURE…] [--units N] [--seed N]``: pulls on the simulated equipment itself.

Sweep, transverse sensitivity and step response are recorded on the equipment of the plant, reduced and evaluated by the product.
Links, capture and archive are left out, and the model of a sweep is given, so that a unit takes a fraction of a second:
:mod:`benchmarks.procedure_pulls` takes seconds through a station. True values and parts of recipes are as there; every unit has
equipment of its own.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.procedure_pulls import PARTS, covered, station_of, tell
from benchmarks.procedure_truths import of_axis, truths
from inertial.dynamics.transfer_model import fit_transfer
from pipelines.procedures import PROCEDURES, step_response
from pipelines.procedures.figures import FigureValue
from pipelines.procedures.recorded import REFERENCE, Device, ProcedureRecord, UnitRecord
from pipelines.procedures.sweep_points import transfer_points
from pipelines.procedures.transfer_figures import figures_of_transfer
from schemas.lot import Lot, Unit
from schemas.toml_files import parse_toml
from stations.plant.bench import Bench, Waveforms
from stations.plant.plant import Plant

NAMES = ("sweep", "transverse", "step_response")
MODEL = ("second_order", "two_pole", "delay")  # what the simulated chain is
UNIT = "B00"
TICK_US = 1_000_000


class Equipment:
    """The orders of the procedures, carried out by the plant without links."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._tick = 0

    def sine(self, frequency: float, level: float, axis: int, seconds: float, slots: Sequence[int]) -> Waveforms:
        """A dwell along an axis."""
        return self._bench.sine(frequency, level, axis, seconds, self._next())

    def sine_across(
        self, frequency: float, level: float, axis: int, angle: float, seconds: float, slots: Sequence[int]
    ) -> Waveforms:
        """A dwell across an axis."""
        return self._bench.sine(frequency, level, axis, seconds, self._next(), across_deg=angle)

    def step(self, volts: float, hold_s: float, before_s: float, slots: Sequence[int]) -> Waveforms:
        """A step of voltage at the self-test inputs."""
        return self._bench.self_test(volts, hold_s, before_s, 2.0 * hold_s, self._next())

    def _next(self) -> int:
        self._tick += TICK_US
        return self._tick


def figures_of(name: str, seed: int) -> tuple[list[FigureValue], Plant]:
    """Figures of one unit on equipment of its own, for axis z where there are several."""
    plant = Plant(station_of(name, seed), Lot(units=[Unit(serial=UNIT, slot=0)], device="SF1500", seed=seed))
    procedure: Any = PROCEDURES[name]
    part = procedure.part.model_validate({"kind": name, **parse_toml(PARTS[name], name)})
    equipment, device = Equipment(plant.bench), Device({}, {}, plant.preset.full_scale, "V")
    readings = pd.DataFrame({"unit": [UNIT], "unit_C": [25.0]})
    records: list[ProcedureRecord] = []
    for number, step in enumerate(procedure.steps(part, None)):
        waves = procedure.measure(equipment, step, [0])
        own = UnitRecord(np.arange(len(waves.outputs)) / waves.rate_hz, waves.outputs[:, 0])
        reference = UnitRecord(np.arange(len(waves.reference)) / waves.reference_rate_hz, waves.reference)
        records.append(ProcedureRecord(number, step, readings, {UNIT: own, REFERENCE: reference}))
    points = procedure.reduce(part, records, device)
    if name == "sweep":
        response = transfer_points(points)
        fit = fit_transfer(response, MODEL)
        diagnosis: Any = SimpleNamespace(extended=fit, adequate=True, unexplained=False)
        return figures_of_transfer(part, diagnosis, response, None), plant
    return list(procedure.evaluate(part, points, device).figures[UNIT]), plant


def main() -> None:
    """The pulls of what is named, or of all three."""
    reader = argparse.ArgumentParser()
    reader.add_argument("procedures", nargs="*", default=list(NAMES))
    reader.add_argument("--units", type=int, default=200)
    reader.add_argument("--seed", type=int, default=2026)
    asked = reader.parse_args()
    step_response.worst = of_axis("z")
    for name in asked.procedures or list(NAMES):
        begun = time.process_time()
        rows: list[dict[str, Any]] = []
        for k in range(asked.units):
            figures, plant = figures_of(name, asked.seed + 17 * k)
            known = truths(name, plant, 0)
            for one in figures:
                row: dict[str, Any] = {
                    "figure": one.figure, "value": one.value, "uncertainty": one.uncertainty, "low": one.low, "high": one.high,
                    "known": one.identified, "true": known[one.figure],
                }  # fmt: skip
                pull = (one.value - known[one.figure]) / one.uncertainty
                rows.append(row | {"pull": pull, "held": covered(row, known[one.figure])})
        for figure, own in pd.DataFrame(rows).groupby("figure", sort=False):
            tell(str(figure), own)
        print(f"  {name}: {asked.units} units, processor {time.process_time() - begun:.0f} s", flush=True)


if __name__ == "__main__":
    main()
