"""Ripple on the supply of the simulated station: the rejection of each unit is that of its regulator and output stage."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from procedure_records import procedure_records
from small_station import captured, lot_of, plant_of, short_recipe, station_of

from pipelines.procedures import PROCEDURES, parts_of, refuse_unusable, roles_of
from pipelines.procedures.figures import FigureValue, Outcome
from schemas.errors import RecipeInvalid
from schemas.recipe import Recipe
from schemas.station import load_station
from schemas.station_devices import Device, Equipment

RIPPLE: Any = PROCEDURES["supply_ripple"]
FREQUENCIES = [20.0, 200.0, 1000.0]
SHIFT_G = 0.05  # bias of a device for a supply that is gone, as the plant has it


def recipe_of(device: str, scale: float, **keys: Any) -> Recipe:
    part = {"kind": "supply_ripple", "scale": scale, "frequencies_hz": FREQUENCIES, "lasting_s": 2.0} | keys
    return short_recipe().model_copy(update={"device": device, "procedures": [part]})


def outcome(device: str, scale: float, **keys: Any) -> tuple[Outcome, pd.DataFrame]:
    recipe, lot = recipe_of(device, scale, **keys), lot_of(1, device)
    sink = captured(recipe, lot, station_of(), roles=roles_of(recipe))
    (part,), (records, made) = parts_of(recipe), procedure_records(recipe, sink)
    points = RIPPLE.reduce(part, records, made)
    assert not points.duplicated(["unit", "axis", "series", "point"]).any()
    assert len(RIPPLE.chart(part, points).plots[0].traces) == 2
    return RIPPLE.evaluate(part, points, made), points


def by_name(figures: list[FigureValue]) -> dict[str, FigureValue]:
    return {one.figure: one for one in figures}


def test_the_rejection_of_an_output_in_volts_is_that_of_its_regulator_and_its_output_stage() -> None:
    made, points = outcome("SF1500", 0.007)
    devices = plant_of(station_of(), lot_of(1, "SF1500")).physics.devices
    for k, figures in enumerate(made.figures.values()):
        felt = [0.007 * SHIFT_G * abs(devices.ripple_response(hertz)[k]) / 12.0 for hertz in FREQUENCIES]
        true = -20.0 * np.log10(max(felt))  # output in V over ripple in V, of the worst frequency
        found = by_name(figures)["ripple_rejection_dB"]
        assert found.identified
        assert abs(found.value - true) < 4.0 * found.uncertainty
        assert found.uncertainty < 1.0
    quiet = points[points["series"] == "quiet"]
    assert (quiet["value"] < 4.0 * quiet["uncertainty"]).all()
    assert not [one for one in made.findings if one.subject == "without ripple"]


def test_a_digital_output_has_micro_g_per_volt_and_no_decibels() -> None:
    made, _ = outcome("ADXL355", 256000.0, ripple_V=0.3)
    devices = plant_of(station_of(), lot_of(1)).physics.devices
    for k, figures in enumerate(made.figures.values()):
        found = by_name(figures)
        assert "a voltage is needed" in found["ripple_rejection_dB"].note
        true = max(1e6 * SHIFT_G * abs(devices.ripple_response(hertz)[k]) / 3.3 for hertz in FREQUENCIES)
        share = found["ripple_ug_V"]
        assert abs(share.value - true) < 4.0 * share.uncertainty


def test_ripple_that_cannot_be_made_or_sampled_is_refused() -> None:
    with pytest.raises(RecipeInvalid, match=r"frequencies_hz: 1900 Hz, 2\.5 to 1600 Hz is needed"):
        parts_of(recipe_of("SF1500", 0.007, frequencies_hz=[1900.0]))
    plain = Equipment(power_supply=Device(profile="scpi_supply", device_id=243, link="ascii"))
    station = load_station().model_copy(update={"equipment": plain})
    with pytest.raises(RecipeInvalid, match="a supply that adds a sine is needed"):
        refuse_unusable(recipe_of("SF1500", 0.007), station)
    with pytest.raises(RecipeInvalid, match="rate_hz 8000 Hz, at most 4000 Hz"):
        refuse_unusable(recipe_of("SF1500", 0.007, rate_hz=8000.0), load_station())
