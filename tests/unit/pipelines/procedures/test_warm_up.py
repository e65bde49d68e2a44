"""Warm-up time on a simulated station whose devices have nearly no noise: nothing of the station moves it."""

import numpy as np
import pytest
from procedure_records import procedure_records
from small_station import captured, lot_of, short_recipe, station_of

from pipelines.procedures import parts_of, roles_of
from pipelines.procedures.warm_up import PROCEDURE, WarmUpPart, _figure

SIZE_G, TAU_S, BAND_UG = 1e-2, 120.0, 1000.0
QUIET = {"noise_density_ug": 0.5, "bias_instability_ug": 0.0, "rate_random_walk_ug": 0.0}
PART = {"kind": "warm_up", "band_ug": BAND_UG, "off_s": 1200.0, "lasting_s": 1200.0, "scale": 0.007}


@pytest.mark.slow
def test_temperature_switching_and_start_of_the_record_do_not_move_the_warm_up_time() -> None:
    hidden = {"kind": "warm_up", "figures": {"size": SIZE_G, "tau": TAU_S}}
    station = station_of(preset_overrides=QUIET, hidden=[hidden], seed=3)
    recipe = short_recipe().model_copy(update={"device": "SF1500", "soak_min_s": 900.0, "procedures": [PART]})
    part, sink = parts_of(recipe)[0], captured(recipe, lot_of(2, "SF1500", 3), station, roles=roles_of(recipe))
    assert isinstance(part, WarmUpPart)
    points = PROCEDURE.reduce(part, *procedure_records(recipe, sink))
    true = TAU_S * np.log(1e6 * SIZE_G / BAND_UG)
    errors = [_figure(part, str(axis), rows).value - true for (_, axis), rows in points.groupby(["unit", "axis"])]
    assert len(errors) == 6
    assert np.max(np.abs(errors)) < 0.5  # half of the means of 1 s
