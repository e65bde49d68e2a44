"""Temperatures of records that are taken while the devices still follow the chamber."""

import numpy as np
import pandas as pd
import pytest

from inertial.operators import first_order_lag
from pipelines.inquiry.lineage import RunSequence
from pipelines.stages.validate import _stale_temperatures
from schemas.errors import DataRejected

TAU_S = 500.0


def excursion(*, stale: bool) -> pd.DataFrame:
    """Up from 20 to 36 °C and back at 3 K a minute, then a wait: two parts of a recipe that are not settled at."""
    time = np.arange(0.0, 2700.0, 15.0)
    chamber = np.interp(time, [0.0, 320.0, 640.0], [20.0, 36.0, 20.0])
    unit = np.full(time.shape, 20.0) if stale else first_order_lag(time, chamber, TAU_S)
    soak = np.where(time <= 320.0, 0, 1)
    return pd.DataFrame({"unit": "A1", "soak": soak, "chamber_C": chamber, "unit_C": unit})


def test_a_thermometer_behind_the_chamber_on_an_excursion_is_not_stale() -> None:
    readings = excursion(stale=False)
    means = readings.groupby("soak")[["chamber_C", "unit_C"]].mean()
    assert abs(means["unit_C"].diff().iloc[-1]) < 0.2 * abs(means["chamber_C"].diff().iloc[-1])
    assert _stale_temperatures(readings) == []


def test_one_that_never_moves_is() -> None:
    assert [fault.fault for fault in _stale_temperatures(excursion(stale=True))] == ["stale_temperature"]


class Refused:
    """A run that refused both of its units."""

    id = "follow-up"

    def table(self, name: str) -> pd.DataFrame:
        if name == "dwells":
            return pd.DataFrame({"unit": pd.Series([], dtype=str), "dwell": pd.Series([], dtype=int)})
        return pd.DataFrame({"unit": ["A1", "A2"], "refused": True, "reason": "constant output"})


def test_a_follow_up_that_refused_every_unit_is_told() -> None:
    with pytest.raises(
        DataRejected, match=r"no unit was accepted by all of follow-up.*refused 2 of 2 \(constant output\)"
    ):
        RunSequence((Refused(),)).dwells()  # type: ignore[arg-type]
