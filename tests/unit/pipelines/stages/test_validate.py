"""Thermometers that freeze, follow a ramp, or stand still."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from long_suites import mostly_slow
from small_station import lot_of

from inertial.operators import first_order_lag
from pipelines.inquiry.lineage import RunSequence
from pipelines.stages.validate import _stale_temperatures, frozen, validate
from pipelines.tables.summaries import summarised
from schemas.errors import DataRejected

SOAKS, DWELLS = 3, 11


def readings(units: int = 4, resolution: float = 0.01, noise: float = 0.02, seed: int = 0) -> pd.DataFrame:
    """Means of five looks at thermometers of a resolution, in three soaks that settle slowly."""
    rng = np.random.default_rng(seed)
    rows = []
    for record in range(SOAKS * DWELLS):
        soak, place = divmod(record, DWELLS)
        for unit in range(units):
            true = -20.0 + 40.0 * soak + 0.1 * unit + 0.2 * np.exp(-place / 3.0)
            looks = np.round((true + noise * rng.normal(size=5)) / resolution) * resolution
            rows.append({"unit": f"U{unit}", "record": record, "soak": soak, "unit_C": looks.mean()})
    return pd.DataFrame(rows)


def freeze(table: pd.DataFrame, unit: str, first: int) -> pd.DataFrame:
    meant = (table["unit"] == unit) & (table["record"] >= first)
    value = table.loc[meant, "unit_C"].iloc[0]
    return table.assign(unit_C=table["unit_C"].mask(meant, value))


@pytest.mark.parametrize("units", [1, 4, 8])
def test_one_that_freezes_in_the_last_soak_is_found(units: int) -> None:
    [(unit, count, value)] = frozen(freeze(readings(units), "U0", 2 * DWELLS + 2))
    assert (unit, count) == ("U0", DWELLS - 2)
    assert value == pytest.approx(60.0, abs=0.3)
    assert list(frozen(freeze(readings(units), "U0", SOAKS * DWELLS - 3))) == []  # the last few records say nothing
    if units > 1:  # one that was frozen all along is found by its neighbours
        assert [unit for unit, *_ in frozen(freeze(readings(units), "U1", 0))] == ["U1"]


@pytest.mark.parametrize("resolution", mostly_slow([1e-4, 0.01, 0.1, 1.0], 1.0))
@pytest.mark.parametrize("noise", mostly_slow([0.0, 1e-3, 0.02], 0.0, 0.02))
@pytest.mark.parametrize("units", mostly_slow([1, 8], 8))
def test_no_sound_one_is_accused_however_coarse_it_is(resolution: float, noise: float, units: int) -> None:
    assert [list(frozen(readings(units, resolution, noise, seed))) for seed in range(20)] == [[]] * 20


def test_its_unit_is_refused_with_the_reason() -> None:
    lot = lot_of(2)
    table = freeze(readings(2), "U0", 2 * DWELLS).replace(
        {"unit": {"U0": lot.units[0].serial, "U1": lot.units[1].serial}}
    )
    full = table.assign(
        kind="dwell", pose="up", status="ok", overflow=False, chamber_C=table["unit_C"], full_scale=1.0, n=0
    )
    verdicts = validate(summarised([], full), full, lot.units).set_index("unit")
    assert verdicts.loc[lot.units[0].serial, "fault"] == "frozen_temperature"
    assert "to the last digit in the last 11 records" in verdicts.loc[lot.units[0].serial, "reason"]
    assert not verdicts.loc[lot.units[1].serial, "refused"]


TAU_S = 500.0


def excursion(*, stale: bool) -> pd.DataFrame:
    """Up from 20 to 36 °C and back at 3 K a minute, then a wait: two parts of a recipe that are not settled at."""
    time = np.arange(0.0, 2700.0, 15.0)
    chamber = np.interp(time, [0.0, 320.0, 640.0], [20.0, 36.0, 20.0])
    unit = np.full(time.shape, 20.0) if stale else first_order_lag(time, chamber, TAU_S)
    soak = np.where(time <= 320.0, 0, 1)
    return pd.DataFrame({"unit": "A1", "soak": soak, "chamber_C": chamber, "unit_C": unit})


def test_a_thermometer_behind_the_chamber_on_an_excursion_is_not_stale_and_one_that_never_moves_is() -> None:
    readings = excursion(stale=False)
    means = readings.groupby("soak")[["chamber_C", "unit_C"]].mean()
    assert abs(means["unit_C"].diff().iloc[-1]) < 0.2 * abs(means["chamber_C"].diff().iloc[-1])
    assert _stale_temperatures(readings) == []
    assert [fault.fault for fault in _stale_temperatures(excursion(stale=True))] == ["stale_temperature"]


def test_a_follow_up_that_refused_every_unit_is_told() -> None:
    tables = {
        "dwells": pd.DataFrame({"unit": pd.Series(dtype=str), "dwell": pd.Series(dtype=int)}),
        "verdicts": pd.DataFrame({"unit": ["A1", "A2"], "refused": True, "reason": "constant output"}),
    }
    run: Any = SimpleNamespace(id="follow-up", table=tables.__getitem__)
    with pytest.raises(
        DataRejected, match=r"no unit was accepted by all of follow-up.*refused 2 of 2 \(constant output"
    ):
        RunSequence((run,)).dwells()
