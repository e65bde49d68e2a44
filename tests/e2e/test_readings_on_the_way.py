"""Dwells that are read while the temperature moves: what is noted is the mean of the dwell, not what it ends with."""

import numpy as np
from small_station import QUIET, MemorySink, lot_of, quiet_progress, short_recipe, station_of

from pipelines.capture.capture import capture
from schemas.poses import SoakPart
from schemas.recipe import Recipe
from stations.opening import make_plant, serve_plant


def test_the_temperature_of_a_dwell_on_a_ramp_is_that_of_its_middle():
    parts = [
        SoakPart(temperature_C=25.0, poses=[1], verification=[]),
        SoakPart(temperature_C=60.0, poses=[1] * 8, verification=[], settled=False),
    ]
    plain = short_recipe(poses=1, temperatures=(25.0, 60.0))
    changed = {"soaks": [p.model_dump() for p in parts], "verification": [], "dwell_s": 20.0, "rate_hz": 10.0}
    recipe = Recipe.model_validate({**plain.model_dump(), **changed})
    config, lot, sink = station_of(preset_overrides=QUIET), lot_of(2), MemorySink()
    plant = make_plant(config, lot)
    with serve_plant(config, lot, plant) as station:
        capture(station, recipe, lot, sink, progress=quiet_progress)
    readings = sink.all(1).query("record > 0")
    middle = readings["start_s"].to_numpy() + 0.5 * readings["duration_s"].to_numpy()
    true = plant.fixture.temperature.at(middle)[np.arange(len(readings)), readings["slot"].to_numpy()]
    moved = plant.fixture.temperature.at(middle + 5.0) - plant.fixture.temperature.at(middle - 5.0)
    assert np.max(np.abs(moved)) > 0.2  # it does move: half a span late would be a tenth of a degree
    assert np.max(np.abs(readings["unit_C"].to_numpy() - true)) < 0.02
