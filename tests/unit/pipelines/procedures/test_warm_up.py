"""Warm-up time on a simulated station whose devices have nearly no noise: nothing of the station moves it."""

from pathlib import Path

import numpy as np

from pipelines.archive import Archive
from pipelines.capture.capture import capture
from pipelines.jobs.recipes import load_recipe
from pipelines.procedures import parts_of, roles_of
from pipelines.procedures.recorded import nominal_device, procedure_record
from pipelines.procedures.warm_up import PROCEDURE, WarmUpPart, _figure
from pipelines.schedule.steps import steps
from schemas.lot import Lot, Unit
from schemas.progress import silent
from schemas.simulation import Hidden, Simulation
from schemas.station import load_station
from stations import open_station

SIZE_G, TAU_S, BAND_UG = 1e-2, 120.0, 1000.0
QUIET = {"noise_density_ug": 0.5, "bias_instability_ug": 0.0, "rate_random_walk_ug": 0.0}
RECIPE = f"""
name = "warm"
device = "SF1500"
local_gravity_m_s2 = 9.80665
temperatures_C = [25.0]
soak_min_s = 900.0
[[procedures]]
kind = "warm_up"
band_ug = {BAND_UG}
off_s = 1200.0
lasting_s = 1200.0
scale = 0.007
"""


def test_temperature_switching_and_start_of_the_record_do_not_move_the_warm_up_time(tmp_path: Path) -> None:
    station = load_station()
    hidden = [Hidden(kind="warm_up", figures={"size": SIZE_G, "tau": TAU_S})]
    changed = {"preset_overrides": QUIET, "hidden": hidden, "seed": 3}
    simulation = (station.simulation or Simulation()).model_copy(update=changed)
    station = station.model_copy(update={"simulation": simulation})
    path = tmp_path / "recipe.toml"
    path.write_text(RECIPE)
    recipe = load_recipe(str(path))
    lot = Lot(units=[Unit(serial=f"W{k}", slot=k) for k in range(4)], device="SF1500", seed=3)
    records = Archive(tmp_path / "archive").capture("one")
    with open_station(station, lot, roles=roles_of(recipe)) as opened:
        capture(opened, recipe, lot, records, progress=silent, events=records.events)
    readings, part = records.gathered("readings"), parts_of(recipe)[0]
    own = [
        procedure_record(k, step.order, records.samples([k]), readings[readings["record"] == k])
        for k, step in enumerate(steps(recipe))
        if step.order is not None
    ]
    assert isinstance(part, WarmUpPart)
    points = PROCEDURE.reduce(part, own, nominal_device(readings))
    true = TAU_S * np.log(1e6 * SIZE_G / BAND_UG)
    errors = [_figure(part, str(axis), rows).value - true for (_, axis), rows in points.groupby(["unit", "axis"])]
    assert len(errors) == 12
    assert np.max(np.abs(errors)) < 0.5  # half of the means of 1 s
