"""A sweep at several temperatures and pressures on the simulated exciter: what gas and spring of the units do is recognised."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from procedure_records import procedure_records
from small_station import captured, lot_of, short_recipe, station_of

from inertial.dynamics.transfer_diagnosis import TransferDiagnosis, diagnose_transfer
from inertial.dynamics.transfer_effects import EFFECTS
from inertial.dynamics.transfer_effects.gas_damping import viscosity
from pipelines.procedures import PROCEDURES, parts_of, refuse_unusable, roles_of
from pipelines.procedures.sweep_points import transfer_points
from schemas.errors import RecipeInvalid
from schemas.station import load_station
from stations.plant.hidden.spring import AIR_K, AIR_UPAS, GasFilm

SWEEP: Any = PROCEDURES["sweep"]
MODEL = ["second_order", "two_pole", "delay"]
PART = {
    "kind": "sweep", "nominal_scale": 0.007, "low_hz": 100.0, "high_hz": 6000.0, "per_octave": 2, "level_g": 2.0,
    "record_s": 0.1, "effects": MODEL,
}  # fmt: skip


def swept(hidden: dict[str, Any] | None, **keys: Any) -> pd.DataFrame:
    recipe = short_recipe().model_copy(update={"device": "SF1500", "procedures": [PART | keys], "soak_min_s": 900.0})
    config = station_of(hidden=[hidden] if hidden else [])
    sink = captured(recipe, lot_of(1, "SF1500"), config, roles=roles_of(recipe))
    return SWEEP.reduce(parts_of(recipe)[0], *procedure_records(recipe, sink))


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


def test_temperatures_beyond_the_station_are_refused() -> None:
    recipe = short_recipe().model_copy(update={"procedures": [PART | {"other_temperatures_C": [120.0]}]})
    with pytest.raises(RecipeInvalid, match="other_temperatures_C has 120 °C, -40 to 85 °C is allowed"):
        refuse_unusable(recipe, load_station())
