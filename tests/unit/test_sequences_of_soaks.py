"""Soaks with waits of their own, and dwells while the devices still follow the chamber, on the simulated station."""

import pandas as pd
import pytest
import small_station as small

from pipelines.capture.capture import capture
from pipelines.schedule.steps import steps
from schemas.poses import SoakPart
from schemas.recipe import Recipe
from stations import open_station


def in_parts(*parts: SoakPart) -> Recipe:
    plain = small.short_recipe(3)
    content = plain.model_dump() | {
        "verification": [],
        "soaks": [p.model_dump() for p in parts],
        "temperatures_C": [p.temperature_C for p in parts],
    }
    return Recipe.model_validate(content)


def readings(recipe: Recipe) -> pd.DataFrame:
    lot, sink = small.lot_of(1), small.MemorySink()
    with open_station(small.station_of(), lot) as station:
        capture(station, recipe, lot, sink, progress=small.quiet_progress)
    return sink.all(1)


def test_each_pose_of_a_soak_may_have_its_own_wait():
    recipe = in_parts(SoakPart(temperature_C=23.0, poses=[1, 2, 1], waits_s=[0.0, 30.0, 90.0], settled=False))
    assert [s.wait_s for s in steps(recipe)] == [0.0, 30.0, 90.0]
    since = readings(recipe)["since_move_s"].to_numpy()
    assert since - since[0] == pytest.approx([0.0, 30.0, 90.0], abs=0.5)


def test_dwells_of_a_soak_that_is_not_settled_are_read_on_the_way():
    recipe = in_parts(SoakPart(temperature_C=60.0, poses=[1, 2, 1, 2], waits_s=[60.0] * 4, settled=False))
    seen = readings(recipe)
    temperature = seen["unit_C"].to_numpy()
    assert (temperature[1:] > temperature[:-1] + 0.3).all()
    assert temperature[-1] < 45.0
    assert seen["start_s"].iloc[-1] < 400.0


def test_refuses_waits_that_are_not_as_many_as_the_poses():
    with pytest.raises(ValueError, match="soak 1 has 2 waits for 3 poses"):
        in_parts(SoakPart(temperature_C=23.0, waits_s=[1.0, 2.0]))
