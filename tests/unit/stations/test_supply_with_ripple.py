"""A power supply that adds a sine: neither its voltage nor its ripple stays from the records of another procedure."""

from typing import Any

import pytest
from small_station import lot_of

from schemas.errors import StationRefused
from schemas.station import load_station
from stations import open_station


def test_a_ripple_is_on_the_nominal_voltage_and_a_voltage_has_no_ripple() -> None:
    with open_station(load_station(), lot_of(1, "SF1500"), roles=["power_supply"]) as station:
        supply: Any = station.equipment["power_supply"]

        def state() -> tuple[float, float]:
            return supply.values.number("voltage"), supply.values.number("ripple")

        supply.set_voltage(13.0)
        supply.set_ripple(0.1, 100.0)
        assert state() == (12.0, 0.1)
        supply.set_ripple(0.2, 1000.0)
        assert state() == (12.0, 0.2)
        supply.set_voltage(11.0)
        assert state() == (11.0, 0.0)
        supply.set_ripple(0.1, 100.0)
        supply.stand_by()
        assert state() == (12.0, 0.0)
        with pytest.raises(StationRefused, match="correct ripple_V of the recipe"):
            supply.set_ripple(4.0, 100.0)
