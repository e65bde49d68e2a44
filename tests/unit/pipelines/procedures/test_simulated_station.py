"""Procedures on the simulated station: warm-up, ripple on the supply, sweeps at several temperatures and pressures."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from each import each
from procedure_records import procedure_records
from small_station import captured, lot_of, plant_of, short_recipe, station_of

from inertial.dynamics.transfer_diagnosis import TransferDiagnosis, diagnose_transfer
from inertial.dynamics.transfer_effects import EFFECTS
from inertial.dynamics.transfer_effects.gas_damping import viscosity
from pipelines.procedures import PROCEDURES, parts_of, refuse_unusable, roles_of
from pipelines.procedures.figures import FigureValue, Outcome
from pipelines.procedures.recorded import Device
from pipelines.procedures.sweep_points import transfer_points
from pipelines.procedures.warm_up import _figure
from schemas.errors import RecipeInvalid
from schemas.recipe import Recipe
from schemas.station import StationConfig, load_station
from schemas.station_devices import Device as StationDevice
from schemas.station_devices import Equipment
from stations.plant.hidden.spring import AIR_K, AIR_UPAS, GasFilm

SF1500 = 0.007  # V per g


def recipe_of(part: dict[str, Any], device: str = "SF1500") -> Recipe:
    return short_recipe().model_copy(update={"device": device, "procedures": [part], "soak_min_s": 900.0})


def points_of(recipe: Recipe, config: StationConfig, units: int = 1, seed: int = 5) -> tuple[pd.DataFrame, Device]:
    """The points of the one procedure of a recipe, and the device by its readings."""
    sink = captured(recipe, lot_of(units, recipe.device, seed), config, roles=roles_of(recipe))
    (part,), (records, device) = parts_of(recipe), procedure_records(recipe, sink)
    return PROCEDURES[part.kind].reduce(part, records, device), device


SIZE_G, TAU_S, BAND_UG = 1e-2, 120.0, 1000.0
QUIET = {"noise_density_ug": 0.5, "bias_instability_ug": 0.0, "rate_random_walk_ug": 0.0}
WARM_UP = {"kind": "warm_up", "band_ug": BAND_UG, "off_s": 1200.0, "lasting_s": 1200.0, "scale": SF1500}


@pytest.mark.slow
def test_temperature_switching_and_start_of_the_record_do_not_move_the_warm_up_time() -> None:
    """Devices with nearly no noise: nothing of the station moves it."""
    hidden = {"kind": "warm_up", "figures": {"size": SIZE_G, "tau": TAU_S}}
    recipe = recipe_of(WARM_UP)
    points, _ = points_of(recipe, station_of(preset_overrides=QUIET, hidden=[hidden], seed=3), 2, 3)
    true = TAU_S * np.log(1e6 * SIZE_G / BAND_UG)
    part: Any = parts_of(recipe)[0]
    errors = [_figure(part, str(axis), rows).value - true for (_, axis), rows in points.groupby(["unit", "axis"])]
    assert len(errors) == 6
    assert np.max(np.abs(errors)) < 0.5  # half of the means of 1 s


RIPPLE: Any = PROCEDURES["supply_ripple"]
FREQUENCIES = [20.0, 200.0, 1000.0]
SHIFT_G = 0.05  # bias of a device for a supply that is gone, as the plant has it


def rippled(device: str, scale: float, **keys: Any) -> Recipe:
    part = {"kind": "supply_ripple", "scale": scale, "frequencies_hz": FREQUENCIES, "lasting_s": 2.0} | keys
    return recipe_of(part, device)


def outcome(device: str, scale: float, **keys: Any) -> tuple[Outcome, pd.DataFrame]:
    recipe = rippled(device, scale, **keys)
    points, made = points_of(recipe, station_of())
    assert not points.duplicated(["unit", "axis", "series", "point"]).any()
    assert len(RIPPLE.chart(parts_of(recipe)[0], points).plots[0].traces) == 2
    return RIPPLE.evaluate(parts_of(recipe)[0], points, made), points


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


BARE = {"equipment": Equipment(power_supply=StationDevice(profile="scpi_supply", device_id=243, link="ascii"))}


MODEL = ["second_order", "two_pole", "delay"]
PART = {
    "kind": "sweep", "nominal_scale": SF1500, "low_hz": 100.0, "high_hz": 6000.0, "per_octave": 2, "level_g": 2.0,
    "record_s": 0.1, "effects": MODEL,
}  # fmt: skip


def swept(hidden: dict[str, Any] | None, **keys: Any) -> pd.DataFrame:
    return points_of(recipe_of(PART | keys), station_of(hidden=[hidden] if hidden else []))[0]


def judged(rows: pd.DataFrame) -> TransferDiagnosis:
    return diagnose_transfer(transfer_points(rows), MODEL)


WARM = {"other_temperatures_C": [-40.0, 85.0]}


@pytest.mark.slow
def test_damping_that_follows_the_viscosity_of_its_gas_is_recognised_and_its_share_is_right() -> None:
    found = judged(swept({"kind": "gas_film", "figures": {"vented": 0.0, "gap_um": 50.0, "share": 0.8}}, **WARM))
    assert found.adequate is False
    assert found.recommended == ("gas_damping",)
    value, error, *_ = found.extended.of("gas_share")
    assert abs(value - 0.8) < 4.0 * error + 0.04
    assert error < 0.05


@pytest.mark.slow
def test_a_spring_that_softens_is_recognised_in_the_natural_frequency() -> None:
    found = judged(swept({"kind": "softening_spring", "figures": {"times": 5.0}}, **WARM))
    assert found.adequate is False
    assert "natural_temperature" in found.recommended
    value, error, *_ = found.extended.of("natural_tempco_per_K")
    softer = 5.0 * -0.0158 * np.exp(-317.0 / 298.15) * (1.0 + 317.0 / 298.15) / 165.9  # of the modulus, per K at 25 °C
    assert value == pytest.approx(softer / 2.0, rel=0.15)
    assert abs(value) > 5.0 * error


@pytest.mark.slow
def test_a_vented_film_is_recognised_by_the_pressure() -> None:
    rows = swept({"kind": "gas_film", "figures": {"gap_um": 2.0}}, pressures_hPa=[300.0, 100.0])
    assert sorted(rows["pressure_hPa"].fillna(1013.0).round(-1).unique()) == [100.0, 300.0, 1010.0]
    found = judged(rows)
    assert found.adequate is False
    assert found.recommended == ("gas_pressure",)
    # another formula of the slip than that of the plant: the gap is that of the same change of damping
    assert found.extended.of("gap_um")[0] == pytest.approx(2.0, rel=0.3)


@pytest.mark.slow
def test_units_whose_air_changes_nothing_have_an_adequate_model() -> None:
    found = judged(swept(None, pressures_hPa=[300.0], other_temperatures_C=[85.0]))
    assert found.adequate is True


def test_effects_of_the_air_are_candidates_only_where_it_changes() -> None:
    still = transfer_points(swept(None, low_hz=200.0))
    effects = ("gas_damping", "natural_temperature", "gas_pressure")
    assert not any(EFFECTS[name].seen(still.conditions) for name in effects)


def test_sutherlands_formula_agrees_with_the_tables_and_the_film_loses_damping_at_low_pressure() -> None:
    table = np.interp(298.15, AIR_K, AIR_UPAS)
    assert viscosity(AIR_K - 273.15) * table == pytest.approx(AIR_UPAS, rel=0.01)
    room, thin = (GasFilm().sprung(np.array([25.0]), pressure)[1][0] for pressure in (1013.25, 50.0))
    assert room == pytest.approx(1.0)
    assert thin < 0.4


REFUSED = [
    (rippled("SF1500", SF1500, frequencies_hz=[1900.0]), {}, r"frequencies_hz: 1900 Hz, 2\.5 to 1600 Hz is needed"),
    (rippled("SF1500", SF1500), BARE, "a supply that adds a sine is needed"),
    (rippled("SF1500", SF1500, rate_hz=8000.0), {}, "rate_hz 8000 Hz, at most 4000 Hz"),
    (
        recipe_of(PART | {"other_temperatures_C": [120.0]}),
        {},
        "other_temperatures_C has 120 °C, -40 to 85 °C is allowed",
    ),
]


@each(REFUSED)
def test_what_the_station_cannot_make_or_sample_is_refused(row: tuple[Recipe, dict[str, Any], str]) -> None:
    with pytest.raises(RecipeInvalid, match=row[2]):
        refuse_unusable(row[0], load_station().model_copy(update=row[1]))
