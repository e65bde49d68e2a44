"""The procedure of a rotation: keys, tables that cannot turn, a simulated lot, a pause, and what is drawn and told."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from each import each
from procedure_records import procedure_records
from small_station import MemorySink, captured, lot_of, quiet_progress, short_recipe, station_of

from benchmarks.rotation import judge
from pipelines.capture.capture import capture
from pipelines.procedures import PROCEDURES, parts_of, refuse_unusable
from pipelines.procedures.figures import Outcome
from pipelines.procedures.recorded import nominal_device
from schemas.errors import RecipeInvalid
from schemas.event import MemoryLog
from schemas.recipe import Recipe
from schemas.simulation import Turning
from schemas.station import StationConfig, load_station
from schemas.station_devices import Devices
from stations.opening import open_station
from stations.plant.plant import Plant
from stations.plant.turning import places

SCALE = 256000.0  # of an ADXL355, LSB per g
ROTATION: Any = PROCEDURES["rotation"]
LOT = lot_of(1)
Measured = tuple[pd.DataFrame, Outcome, MemorySink]


def recipe_of(**keys: Any) -> Recipe:
    listed = [{key: value for key, value in {"kind": "rotation", "scale": SCALE, **keys}.items() if value is not None}]
    return short_recipe().model_copy(update={"procedures": listed})


def evaluated(recipe: Recipe, sink: MemorySink) -> tuple[pd.DataFrame, Outcome]:
    (records, device), part = procedure_records(recipe, sink), parts_of(recipe)[0]
    points = ROTATION.reduce(part, records, device)
    return points, ROTATION.evaluate(part, points, device)


@pytest.fixture(scope="module")
def measured() -> Measured:
    recipe = recipe_of()
    sink = captured(recipe, LOT)
    return *evaluated(recipe, sink), sink


@pytest.mark.slow
def test_a_lot_gives_what_the_simulated_units_are(measured: Measured) -> None:
    _, outcome, _ = measured
    plant = Plant(load_station(), LOT)
    for k, unit in enumerate(plant.serials):
        true = plant.truth(unit)
        figures = {one.figure: one for one in outcome.figures[unit]}
        assert len(figures) == len(ROTATION.figures)
        off = true.matrix / np.diag(true.matrix)[:, None]
        radius = float(np.hypot(*places(Turning(), [k])[0, :2]))
        truth = {
            "rotation_scale_ppm": 1e6 * (np.diag(true.matrix) - 1.0),
            "rotation_misalignment_mrad": 1e3 * off,
            "rotation_third_order_ug_g3": 1e6 * true.cubic,
            "rotation_second_order_ug_g2": np.zeros(3),
        }
        for name, values in truth.items():
            one = figures[name]
            at = tuple("xyz".index(axis) for axis in one.axis)
            own = values[at[: values.ndim]]
            assert one.identified
            assert abs(one.value - own) < 4.0 * one.uncertainty, name
        assert abs(figures["rotation_radius_mm"].value - 1e3 * radius) < 4.0 * figures["rotation_radius_mm"].uncertainty
        delay = figures["rotation_delay_ms"]
        assert 4.4 < delay.value < 5.1  # five of the encoder less a fraction of one of the device
        assert delay.uncertainty < 0.25
        told = {one.subject: one.text for one in outcome.findings if one.unit == unit}
        assert "adequate" in told["diagnosis"]
        assert "missing effect" not in told
        assert "rate steady" in told["drive"]


def test_the_points_are_few_and_drawn_and_a_unit_without_an_output_that_changes_says_why(measured: Measured) -> None:
    points, _, sink = measured
    part, device = parts_of(recipe_of())[0], nominal_device(sink.all(1))
    own = points[points["unit"] == LOT.units[0].serial]
    assert len(own) == 3 * 3 * (2 * 36 + 3)
    assert len(points) < 0.05 * len(sink.all(0))
    assert [plot.title for plot in ROTATION.chart(part, own).plots] == ["plane xy", "plane yz", "plane xz"]
    assert ROTATION.chart(part, own.assign(value=0.0)) is None
    for value, reason in ((0.0, "constant; check the unit"), (np.nan, "end of its range")):
        outcome = ROTATION.evaluate(part, points.assign(value=value), device)
        (note,) = {one.note for one in outcome.figures[LOT.units[0].serial]}
        assert reason in note


@pytest.mark.slow
def test_a_door_that_opens_during_a_turn_costs_time_and_no_data(measured: Measured) -> None:
    recipe = recipe_of(planes=["xy", "yz"])
    config = station_of(faults=[{"kind": "door", "at_s": 920.0, "for_s": 60.0}])
    sink, events = MemorySink(), MemoryLog()
    with open_station(config, LOT) as station:
        capture(station, recipe, LOT, sink, progress=quiet_progress, events=events)
    assert [e.kind for e in events.recorded() if e.kind in {"spoilt", "resumed"}] == ["spoilt", "resumed"]
    _, outcome = evaluated(recipe, sink)
    for unit in LOT.units:
        new, old = ({one.figure: one for one in made.figures[unit.serial]} for made in (outcome, measured[1]))
        new, old = (one["rotation_misalignment_mrad"] for one in (new, old))
        assert abs(abs(new.value) - abs(old.value)) < 5.0 * (new.uncertainty + old.uncertainty)


WRONG: dict[str, dict[str, Any]] = {
    "did you mean": {"effects": ["second_ordre"]},
    "each may be there once": {"planes": ["xy", "xy"]},
    "planes": {"planes": ["xy"]},
    "rates_deg_s": {"rates_deg_s": []},
    "turns": {"turns": 0},
    "stand_s": {"stand_s": 0.1},
}


@each(WRONG)
def test_a_key_that_is_wrong_is_named(message: str) -> None:
    with pytest.raises(RecipeInvalid, match=message):
        parts_of(recipe_of(**WRONG[message]))


def with_profile(name: str) -> StationConfig:
    station = load_station()
    axis = station.devices.outer.model_copy(update={"profile": name})
    devices = Devices.model_validate(station.devices.model_dump() | {"outer": axis.model_dump()})
    return station.model_copy(update={"devices": devices})


def narrow() -> StationConfig:
    station = load_station()
    return station.model_copy(update={"limits": station.limits.model_copy(update={"inner_deg": (-95.0, 95.0)})})


REFUSED: dict[str, tuple[StationConfig, dict[str, Any]]] = {
    "does not state how late its encoder is read": (with_profile("iai_robo_cylinder"), {}),
    "inner axis of station simulated turns from -95° to 95°, ±200° is needed": (narrow(), {}),
    "±380° is needed for 2 whole turns": (load_station(), {"turns": 2}),
    "at most 30 °/s is allowed": (load_station(), {"rates_deg_s": [31.0]}),
    "are needed to reach 24 °/s": (load_station(), {"lead_deg": 5.0}),
    "has no scale": (load_station(), {"scale": None}),
}


@each(REFUSED)
def test_what_a_table_cannot_do_is_refused_before_anything_moves(message: str) -> None:
    station, keys = REFUSED[message]
    with pytest.raises(RecipeInvalid, match=message):
        refuse_unusable(recipe_of(**keys), station)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_mechanisms_hidden_in_table_and_device_are_named_first() -> None:
    assert judge(100, 7000, nothing=False) >= 95
