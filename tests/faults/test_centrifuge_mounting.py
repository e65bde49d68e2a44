"""Mountings of a centrifuge: ordered at standstill only, confirmed by the machine, and felt at their own radius."""

import math

import numpy as np
import pytest

from schemas.errors import OperatorNeeded, StationRefused
from schemas.recipe import Lot, Unit
from schemas.station import load_station
from stations import open_station
from stations.plant.families.acutrol_3000 import Centrifuge

LOT = Lot(units=[Unit(serial="C1", slot=0), Unit(serial="C2", slot=1)], device="SF1500", seed=5)
RATE = math.degrees(math.sqrt(20.0 * 9.80665 / 0.3))


@pytest.fixture
def machine():
    with open_station(load_station(), LOT, roles=["centrifuge"]) as station:
        yield station.equipment["centrifuge"]


def orders(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, float]]:
    """Each changing line that the simulated machine hears, with the rate at that instant."""
    heard: list[tuple[str, float]] = []
    answer = Centrifuge.answer

    def noted(self: Centrifuge, line: str) -> tuple[str, bool]:
        heard.append((line, self.rate()))
        return answer(self, line)

    monkeypatch.setattr(Centrifuge, "answer", noted)
    return heard


def test_units_are_mounted_at_standstill_with_the_interlock_open(machine, monkeypatch: pytest.MonkeyPatch) -> None:
    heard = orders(monkeypatch)
    machine.spin(400.0, 1, 0.5, [0, 1], 0.5)
    machine.spin(600.0, 1, 0.5, [0, 1], 0.5)
    assert not [line for line, _ in heard if line.startswith((":mount 1,", ":radius 1,", ":int:open"))]
    machine.spin(400.0, -1, 0.5, [0, 1], 0.3)
    changed = [(line, rate) for line, rate in heard if line.startswith((":mount 1,", ":radius 1,"))]
    assert [line for line, _ in changed] == [":mount 1,-1", ":radius 1,0.300000"]
    assert all(abs(rate) < 0.01 for _, rate in changed)
    at = [line for line, _ in heard]
    assert at.index(":int:open 1") < at.index(":mount 1,-1")
    with pytest.raises(StationRefused, match="NA:PARA ERR"):
        machine.values.write("radius", 0.5)  # it turns


def test_the_units_feel_the_acceleration_of_the_radius_that_was_ordered(machine) -> None:
    far = machine.spin(RATE, 1, 1.0, [0, 1], 0.5)
    near = machine.spin(RATE, 1, 1.0, [0, 1], 0.3)
    for slot in (0, 1):
        output = [one.outputs[slot][:, 2].mean() / 0.007 for one in (far, near)]
        assert output[0] - output[1] == pytest.approx(20.0 * (0.5 / 0.3 - 1.0), rel=0.02)
    assert machine.spin(RATE, 1, 1.0, [0, 1]).outputs[0][:, 2].mean() == pytest.approx(
        near.outputs[0][:, 2].mean(), rel=1e-4
    )  # where no radius is ordered it stays


def test_a_mounting_that_is_not_confirmed_asks_for_the_operator_and_goes_on_afterwards(
    machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    mount = Centrifuge._mount
    monkeypatch.setattr(Centrifuge, "_mount", lambda *_: ("OK", True))  # a machine that waits for a person
    with pytest.raises(OperatorNeeded, match=r"mounted the other way round at 0\.3 m are needed"):
        machine.spin(400.0, -1, 0.5, [0, 1], 0.3)
    assert machine.values.number("rate_read") == 0.0
    monkeypatch.setattr(Centrifuge, "_mount", mount)
    found = machine.spin(400.0, -1, 0.5, [0, 1], 0.3)
    assert np.mean(found.outputs[0][:, 2]) < 0.0


def test_a_device_without_a_command_for_the_radius_is_not_told(machine, monkeypatch: pytest.MonkeyPatch) -> None:
    heard = orders(monkeypatch)
    has = type(machine.values).has
    monkeypatch.setattr(type(machine.values), "has", lambda self, name: name != "radius" and has(self, name))
    machine.spin(400.0, 1, 0.5, [0, 1], 0.3)
    assert not any("radius" in line for line, _ in heard)
