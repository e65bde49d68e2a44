"""Limits of the profile and of the station's file: the tighter one holds, before anything moves."""

import pytest
from pydantic import ValidationError
from small_station import lot_of, short_recipe, station_of

from pipelines.capture.capture import check
from pipelines.schedule.steps import steps
from schemas.errors import RecipeInvalid, StationRefused
from schemas.poses import Pose
from schemas.station import StationConfig
from stations.opening import open_station, tighter
from stations.profile_files import load_profile


def limited(**limits):
    config = station_of()
    return config.model_copy(update={"limits": config.limits.model_copy(update=limits)})


def test_the_tighter_bound_holds_on_each_side():
    target, point = load_profile("oriental_az"), load_profile("watlow_f4t")
    assert tighter((-200.0, 200.0), target, "target") == (-200.0, 200.0)
    assert tighter((-500.0, 200.0), target, "target") == (-400.0, 200.0)
    assert tighter((-40.0, 250.0), point, "set_point") == (-40.0, 180.0)
    assert tighter((-90.0, 85.0), point, "set_point") == (-70.0, 85.0)
    assert tighter((0.0, 1.0), point, "no_such_register") == (0.0, 1.0)


def test_bounds_that_exclude_each_other_are_refused_with_both():
    with pytest.raises(
        RecipeInvalid, match=r"set_point from -70\.0 to 180\.0 degC, the station's limits are 190 to 250"
    ):
        tighter((190.0, 250.0), load_profile("watlow_f4t"), "set_point")


@pytest.mark.parametrize(
    ("limits", "recipe", "words"),
    [
        (
            {"outer_deg": (-500.0, 500.0)},
            {"poses": [Pose(name="far", outer_deg=450.0, inner_deg=0.0)]},
            "-400 to 400 deg",
        ),
        ({"outer_deg": (-30.0, 30.0)}, {"poses": [Pose(name="far", outer_deg=45.0, inner_deg=0.0)]}, "-30 to 30 deg"),
        ({"temperature_C": (-90.0, 250.0)}, {"temperatures_C": [200.0]}, "-70 to 180 °C"),
        ({"temperature_C": (0.0, 50.0)}, {"temperatures_C": [60.0]}, "0 to 50 °C"),
        ({"rate_hz": 1e6}, {"rate_hz": 50e3}, "up to 20000 Hz"),
        ({"rate_hz": 200.0}, {"rate_hz": 400.0}, "up to 200 Hz"),
    ],
)
def test_what_either_limit_forbids_is_refused_before_anything_moves(limits, recipe, words):
    asked = short_recipe().model_copy(update=recipe)
    with open_station(limited(**limits), lot_of()) as station:
        with pytest.raises(StationRefused, match=words):
            check(station, asked, steps(asked))
        assert station.clock.now() == 0.0
        assert not station.table.axes["outer"].moving()


def test_speed_and_acceleration_stay_within_what_the_drive_takes():
    with open_station(limited(speed_deg_s=500.0, acceleration_deg_s2=900.0), lot_of(1)) as station:
        axis = station.table.axes["outer"]
        assert (axis._limits.speed_deg_s, axis._limits.acceleration_deg_s2) == (90.0, 200.0)
        station.table.move(90.0, 0.0)
        assert station.clock.now() < 6.0


def test_a_safe_temperature_that_the_station_may_not_reach_is_refused():
    content = station_of().model_dump(mode="json")
    content["limits"]["temperature_C"] = [30.0, 80.0]
    with pytest.raises(ValidationError, match=r"safety\.temperature_C: 25 °C, 30 to 80 °C is allowed"):
        StationConfig.model_validate(content)
    content["safety"]["chamber"] = "off"
    assert StationConfig.model_validate(content).safety.chamber == "off"


@pytest.mark.parametrize(("chamber", "mode"), [("off", "off"), ("hold", "automatic"), ("set_point", "automatic")])
def test_the_safe_state_is_the_one_of_the_file(chamber, mode):
    config = station_of()
    config = config.model_copy(update={"safety": config.safety.model_copy(update={"chamber": chamber})})
    with open_station(config, lot_of(1)) as station:
        station.chamber.set_temperature(60.0)
        station.reader.start(100.0)
        station.table.axes["outer"].start(90.0)
        reached = station.make_safe()
        assert reached.safe, reached.sentence()
        assert station.chamber.mode() == mode
        assert station.chamber.set_point() == (25.0 if chamber == "set_point" else 60.0)
        assert station.reader.sampling() == "stopped"
        assert not station.table.axes["outer"].moving()


def test_a_part_that_does_not_answer_does_not_keep_the_others_from_being_safe():
    config = station_of(faults=[{"kind": "silent", "device": "outer"}])
    with open_station(config, lot_of(1)) as station:
        reached = station.make_safe()
        assert list(reached.failed) == ["outer axis stopped"]
        assert station.chamber.set_point() == 25.0
        assert "outer axis stopped not done" in reached.sentence()
