"""``python -m benchmarks.procedure_pulls [PROCEDURE…] [--units N] [--seed N]``: pulls of figures over simulated units.

A pull is (figure − true value)/standard uncertainty, for axis z. True values are those of the plant's physics, by scipy and by
arithmetic that the product's reductions do not use. Figures of random processes (bias stability, warm-up) have no true value of a
unit. Printed are the number of units with a determined figure, mean and standard deviation of the pulls, and the latter's 95 %
interval.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from scipy import signal
from scipy.stats import chi2

from pipelines.archive import Archive
from pipelines.capture.capture import capture
from pipelines.jobs.recipes import load_recipe
from pipelines.procedures import PROCEDURES, parts_of, roles_of
from pipelines.procedures.recorded import nominal_device, procedure_record
from pipelines.schedule.steps import steps
from schemas.progress import silent
from schemas.recipe import Lot, Unit
from schemas.station import load_station
from stations import open_station
from stations.plant.plant import Plant

if TYPE_CHECKING:
    import pandas as pd

STATION = Path(__file__).resolve().parents[1] / "deploy" / "stations" / "simulated-32.toml"
MOST = 32
SCALE = 0.007
SUPPLIES = (12.0, 11.0, 11.5, 12.5, 13.0)
PARTS = {
    "tilt": "step_deg = 15.0\ndwell_s = 5.0",
    "turn_on": f"cycles = 10\noff_s = 60.0\nwarm_up_s = 1.0\nwindow_s = 10.0\nscale = {SCALE}",
    "ratiometry": f'supplies_V = {list(SUPPLIES)}\naxes = ["z"]\ndwell_s = 10.0\nsettle_s = 1.0',
    "sweep": f"low_hz = 10.0\nhigh_hz = 6000.0\nper_octave = 4\nnominal_scale = {SCALE}\nlevel_g = 2.0\nrecord_s = 0.1",
    "transverse": f"step_deg = 30.0\nrecord_s = 0.2\nscale = {SCALE}",
    "random_vibration": f"seconds = 5.0\nlevels_g = [2.0, 3.0, 4.0]\nscale = {SCALE}",
    "step_response": "steps = 16",
    "shock": f"shocks = 2\nwindow_s = 20.0\nsettle_s = 5.0\nscale = {SCALE}",
    "centrifuge": f"record_s = 2.0\nscale = {SCALE}",
}


def outcome(name: str, count: int, seed: int) -> tuple[pd.DataFrame, Plant]:
    """Figures of a lot, for axis z where a procedure has several, and the plant that it was measured on."""
    station = load_station(STATION)
    lot = Lot(units=[Unit(serial=f"B{k:02d}", slot=k) for k in range(count)], device="SF1500", seed=seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recipe.toml"
        path.write_text(
            'name = "pulls"\ndevice = "SF1500"\nlocal_gravity_m_s2 = 9.80665\ntemperatures_C = [25.0]\nsoak_min_s = 900.0\n'
            f'[[procedures]]\nkind = "{name}"\n{PARTS[name]}\n'
        )
        recipe = load_recipe(str(path))
        records = Archive(str(Path(folder) / "archive")).capture("one")
        with open_station(station, lot, roles=roles_of(recipe)) as opened:
            capture(opened, recipe, lot, records, progress=silent, events=records.events)
        readings = records.gathered("readings")
        taken: list[Any] = [
            procedure_record(k, step.order, records.samples([k]), readings[readings["record"] == k])
            for k, step in enumerate(steps(recipe))
            if step.order is not None
        ]
    procedure, part, device = PROCEDURES[name], parts_of(recipe)[0], nominal_device(readings)
    points = procedure.reduce(part, taken, device)
    if name in {"step_response", "turn_on", "shock"}:
        points = points[points["axis"] == "z"]
    import pandas as pd

    found = procedure.evaluate(part, points, device).figures
    rows = [
        (unit, one.figure, one.axis, one.value, one.uncertainty, one.identified)
        for unit, values in found.items()
        for one in values
    ]
    heads = ["unit", "figure", "axis", "value", "uncertainty", "known"]
    return pd.DataFrame(rows, columns=heads), Plant(station, lot)


def truth(plant: Plant, k: int) -> dict[str, float]:
    """True values of the figures of unit k."""
    bench, own = plant.bench, plant.bench.units[k]
    static = plant.truth(plant.serials[k])
    gain = 1.0 + 1e-6 * static.scale_ppm[2]
    mass, pole = 2.0 * np.pi * own.natural_hz, 2.0 * np.pi * own.low_pass_hz
    chain = np.polymul([1.0 / mass**2, 2.0 * own.damping / mass, 1.0], [1.0 / pole**2, np.sqrt(2.0) / pole, 1.0])
    grid = np.linspace(10.0, 4000.0, 400_001)
    answer: Any = signal.freqs([1.0], chain, worN=cast("Any", 2.0 * np.pi * grid))
    size = np.abs(answer[1])
    t = np.linspace(0.0, 0.012, 240_001)
    out = signal.step(([1.0], np.polymul(chain, [2e-6, 1.0])), T=t)[1]
    at = {level: float(t[np.flatnonzero(out > level)[0]]) for level in (0.1, 0.9)}
    settled = float(t[np.flatnonzero(np.abs(out - 1.0) > 0.02)[-1]])
    quadratic, cubic, g = own.quadratic[2], static.cubic[2], bench.gravity
    shift = [static.supply_gain * (volt / SUPPLIES[0] - 1.0) for volt in SUPPLIES]
    return {
        "sweep_bandwidth_hz": float(grid[np.flatnonzero(size < np.sqrt(0.5))[0]]),
        "sweep_natural_hz": own.natural_hz,
        "sweep_damping": own.damping,
        "transverse_sensitivity_percent": 100.0 * float(np.hypot(*static.misalignment[2, :2])),
        "supply_zero_ug_V": 1e6 * 0.05 / SUPPLIES[0],
        "supply_sensitivity_percent": 100.0 * max(shift, key=abs),
        "vibration_rectification_ug_g2": 1e6 * gain * (quadratic + 3.0 * cubic * g),
        "step_settling_ms": 1e3 * (settled + own.delay_s - 2e-6 * float(np.log(2.0))),  # from 50 % of the drive
        "step_overshoot_percent": 100.0 * float(out.max() - 1.0),
        "step_rise_ms": 1e3 * (at[0.9] - at[0.1]),
        "shock_bias_shift_ug": 0.0,
        "centrifuge_second_order_ug_g2": 1e6 * gain * quadratic,
        "centrifuge_third_order_ug_g3": 1e6 * gain * cubic,
        "turn_on_repeatability_ug": plant.preset.bias_stability_ug,
    }


def main() -> None:
    """The pulls of what is named, or of every procedure that has a true value."""
    reader = argparse.ArgumentParser()
    reader.add_argument("procedures", nargs="*", default=list(PARTS))
    reader.add_argument("--units", type=int, default=200)
    reader.add_argument("--seed", type=int, default=2026)
    asked = reader.parse_args()
    for name in asked.procedures or list(PARTS):
        begun, left, lot = time.process_time(), asked.units, 0
        pulls: dict[str, list[float]] = {}
        lost: dict[str, int] = {}
        while left > 0:
            figures, plant = outcome(name, min(MOST, left), asked.seed + 17 * lot)
            for row in figures.to_dict("records"):
                true = truth(plant, plant.serials.index(row["unit"])).get(row["figure"])
                if true is None:
                    continue
                if not row["known"]:
                    lost[row["figure"]] = lost.get(row["figure"], 0) + 1
                    continue
                pulls.setdefault(row["figure"], []).append((row["value"] - true) / row["uncertainty"])
            left, lot = left - MOST, lot + 1
        for figure, values in pulls.items():
            n = len(values)
            sd = float(np.std(values, ddof=1))
            low, high = (sd * float(np.sqrt((n - 1) / chi2.ppf(q, n - 1))) for q in (0.975, 0.025))
            print(
                f"{figure}: n {n}, not determined {lost.get(figure, 0)}, mean {np.mean(values):+.2f}, sd {sd:.3f} "
                f"[{low:.2f}, {high:.2f}]",
                flush=True,
            )
        print(f"  {name}: processor {time.process_time() - begun:.0f} s", flush=True)


if __name__ == "__main__":
    main()
