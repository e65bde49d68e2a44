"""``python -m benchmarks.procedure_pulls [PROCEDURE…] [--units N] [--seed N]``: pulls of figures over simulated units.

A pull is (figure − true value)/standard uncertainty, for axis z. True values are those of the plant's physics
(:mod:`benchmarks.procedure_truths`); of bias stability they are roots of expected variances of the noise's process. Every lot
has a station of its own, whose reference sensor and radius err differently. The calibration of a reference, the scatter of an
exciter and the rate of a centrifuge are common to the units of a lot, so on such equipment a lot has one unit. Printed are the
number of units with a determined figure, mean and standard deviation of the pulls, the latter's 95 % interval, and the share of
units whose 95 % interval holds the true value. A figure that is a largest magnitude cannot have normal pulls where the true value
is of the size of the noise: linearity by tilt is measured on units whose springs are bent within 1 g (``tilt``), and on units of
the sheet, where the share of intervals alone says whether the uncertainty is right (``tilt_straight``).
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import chi2

from benchmarks.bent_springs import BentSprings
from benchmarks.procedure_truths import (
    BAND_UG,
    CYCLES,
    FLAT_HZ,
    PULSE_S,
    SUPPLIES,
    TWO_RADII_M,
    WARM_G,
    WARM_S,
    WINDOW_S,
    of_axis,
    truths,
)
from pipelines import procedures
from pipelines.archive import Archive
from pipelines.capture.capture import capture
from pipelines.jobs.recipes import load_recipe
from pipelines.procedures import PROCEDURES, parts_of, roles_of, shock_records
from pipelines.procedures.recorded import nominal_device, procedure_record
from pipelines.schedule.steps import steps
from schemas.lot import Lot, Unit
from schemas.progress import silent
from schemas.simulation import Hidden, ReferenceErrors, Simulation
from schemas.station import StationConfig, load_station
from stations.opening import open_station
from stations.plant.plant import Plant

STATION = Path(__file__).resolve().parents[1] / "deploy" / "stations" / "simulated-32.toml"
SCALE = 0.007
TURN_DEG = float(np.degrees(1e-3))  # phase of a dwell on the simulated exciter, one sigma, which 0.06° round up
ACROSS_PPM = (
    2.0  # of an angle: its amplitude, 0.1 %, times a transverse sensitivity of 2 mrad; nothing is mounted again
)
TURN = "step_deg = 15.0\ndwell_s = 5.0"
PARTS = {
    "tilt": TURN,
    "tilt_straight": TURN,
    "bias_stability": f"lasting_s = 3600.0\nscale = {SCALE}",
    "warm_up": f"band_ug = {BAND_UG}\noff_s = 1200.0\nlasting_s = 1200.0\nscale = {SCALE}",
    "turn_on": f"cycles = {CYCLES}\noff_s = 60.0\nwarm_up_s = 1.0\nwindow_s = {WINDOW_S}\nscale = {SCALE}",
    "ratiometry": f'supplies_V = {list(SUPPLIES)}\naxes = ["z"]\ndwell_s = 10.0\nsettle_s = 1.0',
    "sweep": "low_hz = 10.0\nhigh_hz = 6000.0\nper_octave = 4\nlevel_g = 2.0\nrecord_s = 0.1\n"
    f"nominal_scale = {SCALE}\nflat_to_hz = {FLAT_HZ}\nrepeatability_deg = {TURN_DEG}",
    "transverse": f"step_deg = 30.0\nrecord_s = 0.2\nscale = {SCALE}\nscale_percent = 0.2\n"
    f"repeatability_ppm = {ACROSS_PPM}",
    "random_vibration": f"seconds = 5.0\nlevels_g = [2.0, 3.0, 4.0]\nscale = {SCALE}",
    "step_response": "steps = 16",
    "shock": f"shocks = 2\nwindow_s = 20.0\nsettle_s = 5.0\nduration_ms = {1e3 * PULSE_S}\nreference_percent = 0.25\n"
    f"scale = {SCALE}",
    "centrifuge": f"record_s = 2.0\nscale = {SCALE}",
    "centrifuge_radii": f"record_s = 2.0\nradii_m = {list(TWO_RADII_M)}\nscale = {SCALE}",
}
KIND = {"centrifuge_radii": "centrifuge", "tilt_straight": "tilt"}  # further parts of a procedure
ONE_TABLE = {"tilt", "tilt_straight", "bias_stability", "warm_up", "turn_on"}
MOST = 8  # units of a lot on the tilt table; on other equipment all units of a lot share its errors: one unit a lot
TILT_URAD = 34.9  # 0.002°, the standard uncertainty of the table's angle that the part of a recipe states
ONE_AXIS = {"step_response", "turn_on", "shock", "bias_stability", "warm_up"}


def station_of(name: str, seed: int) -> StationConfig:
    """A station with errors of its own; one procedure needs a device that warms up."""
    station = load_station(STATION)
    simulation = (station.simulation or Simulation()).model_copy(update={"seed": seed})
    if KIND.get(name, name) == "tilt":
        simulation = simulation.model_copy(update={"reference_errors": ReferenceErrors(pose_urad=TILT_URAD)})
    if name == "warm_up":
        hidden = [Hidden(kind="warm_up", figures={"size": WARM_G, "tau": WARM_S})]
        simulation = simulation.model_copy(update={"hidden": hidden})
    return station.model_copy(update={"simulation": simulation})


def outcome(name: str, count: int, seed: int) -> tuple[pd.DataFrame, Plant]:
    """Figures of a lot, for axis z where a procedure has several, and the plant that it was measured on."""
    station = station_of(name, seed)
    lot = Lot(units=[Unit(serial=f"B{k:02d}", slot=k) for k in range(count)], device="SF1500", seed=seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recipe.toml"
        path.write_text(
            'name = "pulls"\ndevice = "SF1500"\nlocal_gravity_m_s2 = 9.80665\ntemperatures_C = [25.0]\nsoak_min_s = 900.0\n'
            f'[[procedures]]\nkind = "{KIND.get(name, name)}"\n{PARTS[name]}\n'
        )
        recipe = load_recipe(str(path))
        records = Archive(str(Path(folder) / "archive")).capture("one")
        # a device whose K2 and K3 show within 1 g
        springs = [BentSprings(lot.seed, [unit.serial for unit in lot.units])] if name == "tilt" else []
        with open_station(station, lot, hidden=springs, roles=roles_of(recipe)) as opened:
            capture(opened, recipe, lot, records, progress=silent, events=records.events)
        readings = records.gathered("readings")
        taken: list[Any] = [
            procedure_record(k, step.order, records.samples([k]), readings[readings["record"] == k])
            for k, step in enumerate(steps(recipe))
            if step.order is not None
        ]
    procedure: Any = PROCEDURES[KIND.get(name, name)]
    part, device = parts_of(recipe)[0], nominal_device(readings)
    points = procedure.reduce(part, taken, device)
    if name in ONE_AXIS:
        points = points[points["axis"] == "z"]
    figures = procedure.evaluate(part, points, device).figures
    rows = [
        (unit, one.figure, one.axis, one.value, one.uncertainty, one.low, one.high, one.identified)
        for unit, values in figures.items()
        for one in values
    ]
    heads = ["unit", "figure", "axis", "value", "uncertainty", "low", "high", "known"]
    return pd.DataFrame(rows, columns=heads), Plant(station, lot)


def covered(row: dict[str, Any], true: float) -> bool:
    """Whether the 95 % interval of a figure holds the true value; an upper limit has no lower end."""
    low, high = row["low"], row["high"]
    if row["figure"] == "turn_on_upper_limit_ug":
        return true <= row["value"]
    if not np.isfinite(low) or not np.isfinite(high):
        low, high = row["value"] - 1.96 * row["uncertainty"], row["value"] + 1.96 * row["uncertainty"]
    return bool(low <= true <= high)


def main() -> None:
    """The pulls of what is named, or of every procedure that determines figures."""
    reader = argparse.ArgumentParser()
    reader.add_argument("procedures", nargs="*", default=list(PARTS))
    reader.add_argument("--units", type=int, default=200)
    reader.add_argument("--seed", type=int, default=2026)
    reader.add_argument("--units-per-lot", type=int, help="by default 8 on the tilt table, 1 on other equipment")
    asked = reader.parse_args()
    for name in asked.procedures or list(PARTS):
        setattr(getattr(procedures, KIND.get(name, name)), "worst", of_axis("z"))  # noqa: B010 - not every module has one
        shock_records.diagnosis_text = lambda *_: []  # it enters no figure
        begun, left, lot = time.process_time(), asked.units, 0
        rows: list[dict[str, Any]] = []
        while left > 0:
            most = min(asked.units_per_lot or (MOST if name in ONE_TABLE else 1), left)
            figures, plant = outcome(name, most, asked.seed + 17 * lot)
            known = {unit: truths(name, plant, k) for k, unit in enumerate(plant.serials)}
            whole: list[dict[str, Any]] = [{str(k): v for k, v in row.items()} for row in figures.to_dict("records")]
            for row in whole:
                true = known[row["unit"]][row["figure"]]
                error = row["uncertainty"] if row["uncertainty"] > 0.0 else np.nan
                rows.append(row | {"true": true, "pull": (row["value"] - true) / error, "held": covered(row, true)})
            left, lot = left - most, lot + 1
        table = pd.DataFrame(rows)
        for figure, own in table.groupby("figure", sort=False):
            tell(str(figure), own)
        print(f"  {name}: {lot} stations, processor {time.process_time() - begun:.0f} s", flush=True)


def tell(figure: str, own: pd.DataFrame) -> None:
    """Print the pulls of a figure from the rows (units, …) of ``pull``, ``held``, ``known``, ``true`` and ``uncertainty``."""
    known = own[own["known"]]
    n, lost = len(known), len(own) - len(known)
    if not n:
        print(f"{figure}: not determined for any of {lost}", flush=True)
        return
    pulls = known["pull"].to_numpy(dtype=float)
    sd = float(np.std(pulls, ddof=1))
    low, high = (sd * float(np.sqrt((n - 1) / chi2.ppf(q, n - 1))) for q in (0.975, 0.025))
    size = float((known["true"].abs() / known["uncertainty"].where(known["uncertainty"] > 0.0)).median())
    print(
        f"{figure}: n {n}, not determined {lost}, mean {np.mean(pulls):+.2f}, sd {sd:.3f} [{low:.2f}, {high:.2f}], "
        f"95 % interval holds {100.0 * known['held'].mean():.0f} %, true value {size:.3g} u (median)",
        flush=True,
    )


if __name__ == "__main__":
    main()
