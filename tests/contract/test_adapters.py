"""Every profile of a drive or a chamber: the production adapter drives the simulated device behind it."""

import math
from contextlib import contextmanager

import pytest
from each import each
from other_devices import station_with
from small_station import lot_of

from schemas.errors import LinkLost, OperatorNeeded, RecipeInvalid, StationRefused, StationTimeout
from stations.devices.adapters import adapter_of
from stations.devices.table import TableAxis
from stations.opening import make_plant, serve_plant
from stations.profile_files import load_profile, profile_names

STATION_ERRORS = (StationRefused, OperatorNeeded, StationTimeout)
DRIVES = [name for name in profile_names() if load_profile(name).kind == "axis"]
CONTROLLERS = [name for name in profile_names() if load_profile(name).kind == "chamber"]


@contextmanager
def opened(axis: str = "oriental_az", chamber: str = "watlow_f4t"):
    config, lot = station_with(axis, chamber), lot_of(1)
    plant = make_plant(config, lot)
    with serve_plant(config, lot, plant) as station:
        yield station, plant


@each([name for name in profile_names() if load_profile(name).maker != "Tumbleline"])
def test_profiles_of_real_devices_say_where_everything_comes_from(name):
    profile = load_profile(name)
    assert not profile.verified  # until somebody holds one against the device
    assert profile.source
    for entry in (*profile.registers, *profile.commands):
        assert entry.manual, entry.name
        if entry.writable and entry.unit:
            assert (entry.minimum, entry.maximum) != (None, None), entry.name


@each(DRIVES)
def test_an_axis_goes_where_it_is_told_stops_and_refuses_what_it_may_not_do(name):
    with opened(axis=name) as (station, plant):
        axis, move = station.table.axes["outer"], plant.outer.move
        for outer, inner in ((70.0, -30.0), (70.0, 12.5), (-180.0, 0.0)):
            station.table.move(outer, inner)
            assert station.table.angles() == pytest.approx((outer, inner), abs=max(0.01, axis.resolution_deg))
            assert plant.outer.move.target == pytest.approx(outer, abs=0.005)
            assert plant.inner.move.target == pytest.approx(inner, abs=0.005)
        move = plant.outer.move
        assert (move.speed, move.acceleration) == pytest.approx((30.0, 30.0), rel=0.05)
        station.table.move(0.0, 0.0)
        axis.start(90.0)
        station.clock.sleep(1.0)
        assert axis.moving()
        axis.stop()
        station.clock.sleep(5.0)
        assert not axis.moving()
        assert 1.0 < axis.position() < 80.0
        with pytest.raises(StationRefused, match="200 deg is allowed"):
            axis.start(250.0)
        axis.start(40.0)
        with pytest.raises(StationRefused, match="busy"):
            axis.start(10.0)
        station.clock.sleep(60.0)
        plant.outer.homed = False
        with pytest.raises(OperatorNeeded, match="home"):
            axis.start(10.0)
        assert axis.position() == pytest.approx(40.0, abs=max(0.01, axis.resolution_deg))
        if name in {"smc_lecp6", "iai_robo_cylinder"}:
            plant.outer.homed = plant.emergency_stop = True
            with pytest.raises(OperatorNeeded, match="emergency stop"):
                station.table.move(10.0, 0.0)


@each(CONTROLLERS)
def test_a_chamber_gets_where_it_is_told_refuses_what_is_not_allowed_and_switches_off_or_says_that_it_cannot(name):
    with opened(chamber=name) as (station, plant):
        chamber = station.chamber
        chamber.set_temperature(-12.3)
        assert plant.fixture.chamber.set_point == pytest.approx(-12.3, abs=0.051)
        assert chamber.set_point() == pytest.approx(-12.3, abs=0.051)
        assert chamber.mode() == chamber.running
        station.clock.sleep(3600.0)
        assert chamber.temperature() == pytest.approx(-12.3, abs=0.1)
        before = plant.fixture.chamber.set_point
        for temperature in (-41.0, 86.0, math.nan):
            with pytest.raises(StationRefused, match="85 °C is allowed"):
                chamber.set_temperature(temperature)
        assert plant.fixture.chamber.set_point == before
        if not load_profile(name).has("mode") or not load_profile(name).entry("mode").writable:
            with pytest.raises(StationRefused, match="has no writable mode"):
                chamber.off()
            return
        if name == "binder_mb1":  # both are written because sources disagree
            both = [plant.banks[3]._sources[one]() for one in ("set_point_basic", "set_point_manual")]
            assert both == pytest.approx([-12.3, -12.3], abs=0.051)
        chamber.off()
        assert not plant.fixture.chamber.running
        chamber.on()
        assert plant.fixture.chamber.running


STATES = [
    ("watlow_f4t", "program_state", "runs", OperatorNeeded, "program is in state runs"),
    ("watlow_f4t", "alarm_1", 99, OperatorNeeded, "alarm 1 in state unknown"),
    ("watlow_f4s", "status", "program_holds", OperatorNeeded, "program is in state program_holds"),
    ("binder_mb1", "mode", "program", OperatorNeeded, "program is in state runs"),
    ("eurotherm_3200", "program_status", "runs", OperatorNeeded, "program is in state runs"),
    ("watlow_f4t", "set_point_low", -10.0, StationRefused, "the controller allows -10 to 180 °C"),
    *((name, "temperature_unit", "fahrenheit", StationRefused, "shows fahrenheit, celsius is needed")
      for name in ("watlow_f4t", "watlow_f4s")),
]  # fmt: skip


@each(STATES)
def test_a_program_an_alarm_another_unit_or_narrower_limits_of_the_controller_are_refused(case):
    name, register, state, error, told = case
    with opened(chamber=name) as (station, plant):
        plant.banks[3]._sources[register] = lambda: state
        with pytest.raises(error, match=told):
            station.chamber.set_temperature(-20.0)
        assert plant.fixture.chamber.set_point == 23.0


def test_an_espec_with_a_program_or_an_alarm_needs_a_person_and_refuses_by_name():
    with opened(chamber="espec_p300") as (station, plant):
        speaker = plant.line_devices[3]
        speaker._mode = "RUN"
        with pytest.raises(OperatorNeeded, match="program is in state runs"):
            station.chamber.set_temperature(40.0)
        speaker._mode = "STANDBY"
        station.chamber.set_temperature(40.0)  # constant operation again
        assert station.chamber.mode() == "CONSTANT"
        speaker._high = 30.0
        with pytest.raises(StationRefused, match="the controller allows"):
            station.chamber.set_temperature(35.0)
        with pytest.raises(StationRefused, match="NA:DATA OUT OF RANGE"):
            station.chamber._values.write("set_point", 35.0)


def test_decimals_of_a_watlow_f4_are_those_that_it_is_set_to():
    config, lot = station_with(chamber="watlow_f4s"), lot_of(1)
    for decimals in (0, 2):
        plant = make_plant(config, lot)
        bank = plant.banks[3]
        bank._sources["decimals"] = lambda n=decimals: n
        bank._registers = [bank._scaled(register) for register in bank.profile.registers]
        with serve_plant(config, lot, plant) as station:
            station.chamber.set_temperature(41.0)
            assert plant.fixture.chamber.set_point == 41.0


class Recorder:
    """A link that notes every write; ``values`` are what reads give."""

    def __init__(self, inner):
        self.inner, self.written = inner, []

    def read(self, device_id, address, count, what, space="holding"):
        return self.inner.read(device_id, address, count, what, space)

    def write(self, device_id, address, words, what, space="holding", *, since=None):
        self.written.append((space, address, len(words)))
        self.inner.write(device_id, address, words, what, space, since=since)

    def close(self):
        self.inner.close()


def test_nothing_ever_writes_the_set_points_of_an_eurotherm_that_wear_its_memory():
    profile = load_profile("eurotherm_3200")
    wearing = {2, 24, 25, *(0x8000 + 2 * n + i for n in (2, 24, 25) for i in (0, 1))}
    assert not wearing & {a for r in profile.registers if r.writable for a in range(r.address, r.end)}
    with opened(chamber="eurotherm_3200") as (station, plant):
        values = station.chamber._values
        values._link = recorder = Recorder(values._link)
        local = plant.banks[3]._sources["set_point_1"]()
        for temperature in (40.0, -20.0, 25.0):
            station.chamber.set_temperature(temperature)
        assert plant.banks[3]._sources["set_point_1"]() == local
    assert {address for _, address, _ in recorder.written} == {276, 0x8034}
    assert [address for _, address, _ in recorder.written].count(276) == 1  # enabled after the first set point


def test_an_iai_drive_has_its_band_before_its_target_and_an_smc_drive_its_start_alone_and_last():
    written = {}
    for name in ("iai_robo_cylinder", "smc_lecp6"):
        with opened(axis=name) as (station, _):
            registers = station.table.axes["outer"]._registers
            registers._link = recorder = Recorder(registers._link)
            station.table.move(10.0, 0.0)
            station.table.move(20.0, 0.0)
        written[name] = recorder.written
    assert [at for space, at, _ in written["iai_robo_cylinder"] if space == "holding"] == [0x9902, 0x9900] * 2
    assert [w[1:] for w in written["smc_lecp6"] if w[0] == "holding"] == [(0x9102, 16), (0x9100, 1)] * 2
    assert [w[1:] for w in written["smc_lecp6"] if w[0] == "coil"] == [(0x30, 1), (0x19, 1)]


STARTS = {"oriental_az": 0x58, "smc_lecp6": 0x9100, "iai_robo_cylinder": 0x9900, "universal_robots": 131}


@each([(name, lost) for name in DRIVES for lost in (StationTimeout, LinkLost)])
def test_an_order_whose_answer_is_lost_is_read_back_and_not_given_again(case):
    name, lost = case

    class Lossy(Recorder):
        def write(self, device_id, address, words, what, space="holding", *, since=None):
            super().write(device_id, address, words, what, space, since=since)
            if address == STARTS[name]:
                raise lost("answer lost")

    with opened(axis=name) as (station, plant):
        station.table.move(5.0, 5.0)
        registers, before = station.table.axes["outer"]._registers, plant.outer._moves
        registers._link = lossy = Lossy(registers._link)
        station.table.move(60.0, 5.0)
        assert plant.outer._moves == before + 1
        assert [address for _, address, _ in lossy.written].count(STARTS[name]) == 1


ORDERS = ["high_first", "low_first", "high_first_swapped", "low_first_swapped"]


@each(ORDERS)
def test_a_drive_may_be_set_to_any_of_four_word_orders_and_does_not_move_in_another(order):
    config, lot = station_with(), lot_of(1)
    turned = {
        name: getattr(config.devices, name).model_copy(update={"word_order": order}) for name in ("outer", "inner")
    }
    config = config.model_copy(update={"devices": config.devices.model_copy(update=turned)})
    plant = make_plant(config, lot)
    with serve_plant(config, lot, plant) as station:
        station.table.move(70.0, -30.0)
    assert plant.outer.move.target == pytest.approx(70.0)
    if order != ORDERS[0]:  # than the file says
        plant = make_plant(station_with(), lot)
        with serve_plant(config, lot, plant) as station, pytest.raises(STATION_ERRORS):
            station.table.move(70.0, -30.0)
        assert plant.outer.move.target == 0.0


def test_a_profile_without_what_its_adapter_needs_or_on_a_link_of_another_kind_is_refused_by_name():
    profile = load_profile("oriental_az")
    kept = [register for register in profile.registers if register.name != "alarm"]
    with pytest.raises(RecipeInvalid, match="alarm missing"):
        adapter_of(profile.model_copy(update={"registers": kept}), "axis", TableAxis)
    config = station_with(chamber="espec_p300")
    chamber = config.devices.chamber.model_copy(update={"link": "tcp"})
    config = config.model_copy(update={"devices": config.devices.model_copy(update={"chamber": chamber})})
    plant = make_plant(config, lot_of(1))
    with pytest.raises(RecipeInvalid, match="espec_p300 is carried by ascii"), serve_plant(config, lot_of(1), plant):
        pass
