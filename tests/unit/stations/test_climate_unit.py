"""Test equipment of the simulated station: the climate unit's legs, and a supply whose ripple and voltage do not stay."""

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from each import each
from small_station import lot_of

from schemas.errors import OperatorNeeded, StationRefused
from schemas.fault import FaultOrder
from schemas.station import load_station, with_faults
from stations import open_station
from stations.devices.equipment import RecordingSpoilt

ROOM_HPA = 1013.25


@contextmanager
def opened(*faults: FaultOrder) -> Generator[Any]:
    with open_station(with_faults(load_station(), list(faults)), lot_of(2), roles=["climate"]) as station:
        yield station


def test_a_leg_goes_to_its_air_on_a_straight_line_and_the_recording_shows_it() -> None:
    with opened() as station:
        unit = station.equipment["climate"]
        made = unit.expose(60.0, 90.0, 500.0, 1200.0, 1800.0, [0, 1])
        air = made.reference
        assert air.shape == (300, 3)
        assert air[-20:].mean(axis=0) == pytest.approx([60.0, 90.0, 500.0], abs=0.3)
        half = round(600.0 * made.reference_rate_hz)
        assert air[half, 2] == pytest.approx((ROOM_HPA + 500.0) / 2.0, abs=10.0)
        assert set(made.outputs) == {0, 1}
        assert np.ptp(made.outputs[0][:, 2]) > 0.0
        # humidity and pressure stay when the leg has ended, and the chamber takes the temperature over
        station.clock.sleep(3600.0)
        still = unit.expose(60.0, 90.0, 500.0, 1.0, 600.0, [0]).reference
        assert still[:3, 1:].mean(axis=0) == pytest.approx([90.0, 500.0], abs=0.6)
        unit.make_safe()
        room = unit.expose(60.0, None, ROOM_HPA, 1.0, 600.0, [0]).reference
        assert room[:, 2].mean() == pytest.approx(ROOM_HPA, abs=0.3)
        assert room[-1, 1] < 30.0


def test_a_shock_changes_the_air_within_minutes() -> None:
    with opened() as station:
        air = station.equipment["climate"].expose(-40.0, None, ROOM_HPA, 60.0, 900.0, [0]).reference[:, 0]
        assert air[round(180.0 / 10.0)] < -39.0


STOPPED = [
    ((), (25.0, 95.0, 30.0), OperatorNeeded, r"humidity at .* at the end of the leg, 95 ± 5 % was ordered"),
    ((), (200.0, None, 60.0), StationRefused, r"temperature 200\.0; -75\.0 to 180.0"),
    (("controller_abort",), (40.0, None, 60.0), OperatorNeeded, "door of the climate unit open"),
    (("missed_trigger",), (40.0, None, 60.0), RecordingSpoilt, "trigger was missed"),  # it is taken again
]


@each(STOPPED)
def test_what_stops_a_leg_is_told(row) -> None:
    faults, (celsius, humidity, seconds), error, told = row
    with opened(*(FaultOrder(kind=kind, at_s=0.0) for kind in faults)) as station, pytest.raises(error, match=told):
        station.equipment["climate"].expose(celsius, humidity, ROOM_HPA, 1.0, seconds, [0])


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
