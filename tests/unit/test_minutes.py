"""Station time as it is planned, against what the simulated station takes by its own clock."""

import dataclasses

import pytest
from small_station import MemorySink, lot_of, quiet_progress, short_recipe, station_of

from pipelines.stages.capture import capture, steps
from pipelines.stages.minutes import Standing, minutes
from schemas.recipe import Pose
from stations.opening import open_station


def really_taken(recipe, config):
    """Minutes of the plant's clock, in all and of the soaks."""
    with open_station(config, lot_of(8)) as station:
        sink = MemorySink()
        begun = station.clock.now()
        soaks = []
        inner = station.soak

        def soak(*given):
            took = inner(*given)
            soaks.append(took)
            return took

        watched = dataclasses.replace(station)
        object.__setattr__(watched, "soak", soak)
        capture(watched, recipe, lot_of(8), sink, progress=quiet_progress)
        return (station.clock.now() - begun) / 60.0, sum(soaks) / 60.0


@pytest.mark.parametrize(("temperatures", "poses"), [((25.0, 60.0, -10.0), 6), ((10.0, 15.0, 20.0, 15.0, 10.0), 4)])
def test_planned_minutes_are_those_the_station_takes(temperatures, poses):
    recipe = short_recipe(poses, static_s=60.0).model_copy(update={"temperatures_C": list(temperatures)})
    config = station_of()
    total, soaks = really_taken(recipe, config)
    planned = minutes(steps(recipe), config, recipe)
    assert planned.total == pytest.approx(total, rel=0.1)
    assert planned.soaks == pytest.approx(soaks, rel=0.1)
    assert planned.total - planned.soaks == pytest.approx(total - soaks, rel=0.1)


def test_parts_of_the_planned_time_are_told_apart():
    recipe = short_recipe(2, static_s=120.0)
    planned = minutes(steps(recipe), station_of(), recipe)
    assert planned.static_record == pytest.approx(2.0)
    assert planned.dwells == pytest.approx(3 * 2.0 / 60.0)
    assert planned.total == pytest.approx(planned.moves + planned.soaks + planned.dwells + planned.static_record)


def test_a_station_that_is_soaked_already_only_moves_and_dwells():
    recipe = short_recipe(1)
    first = steps(recipe)[0]
    standing = Standing(outer=0.0, inner=0.0, air=25.0, device=25.0, soak=first.soak)
    planned = minutes([first], station_of(), recipe, standing)
    assert planned.soaks == 0.0
    assert planned.dwells > 0.0


def test_far_moves_and_slow_axes_take_longer():
    recipe, config = short_recipe(1), station_of()
    near, far = (
        dataclasses.replace(steps(recipe)[0], pose=Pose(name="p", outer_deg=angle, inner_deg=0.0))
        for angle in (10, 180)
    )
    slow = config.model_copy(update={"limits": config.limits.model_copy(update={"speed_deg_s": 5.0})})
    assert minutes([far], config, recipe).moves > minutes([near], config, recipe).moves
    assert minutes([far], slow, recipe).moves > 3.0 * minutes([far], config, recipe).moves


def test_hardware_takes_its_pace_from_the_stations_file():
    recipe = short_recipe(1, temperatures=(60.0,))
    config = station_of().model_copy(update={"simulation": None})
    fast = config.model_copy(update={"pace": config.pace.model_copy(update={"ramp_K_per_min": 10.0, "lag_s": 60.0})})
    assert minutes(steps(recipe), fast, recipe).soaks < minutes(steps(recipe), config, recipe).soaks
