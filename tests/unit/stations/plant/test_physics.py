"""Physics of the simulated station, seen from its truth, and the journal of what was done to it."""

import json
import zlib
from functools import cache

import numpy as np
import pytest
from long_suites import mostly_slow
from small_station import QUIET, lot_of, plant_of, station_of, turn_to, write

from inertial.frames import force_from_angles
from schemas.errors import RecipeInvalid, WrongUse
from schemas.fault import FaultOrder
from schemas.lot import Lot, Unit
from stations.codec import unpack_samples
from stations.plant.fixture import Chamber, Moisture
from stations.plant.hidden import HIDDEN, hidden_effect
from stations.plant.journal import Injection, Journal, LineOrder, Write
from stations.plant.preset import load_preset
from stations.plant.table import Axis, Move, turn


def mean_counts(plant, seconds=2, slot_id=11):
    write(plant, 10, "rate", 100.0)
    write(plant, 10, "sampling", "running")
    plant.advance(seconds * 1_000_000)
    write(plant, 10, "sampling", "stopped")
    width = 4 if plant.preset.packing == "int20x3" else 5
    n = plant.sampler.head
    words = [w for i in range(n) for w in plant.banks[slot_id].read(1000 + i * width, width)[0][1]]
    counts, _ = unpack_samples(np.array(words, dtype=np.uint16), plant.preset.packing)
    return counts.mean(axis=0)


def still(**simulation):
    return station_of(preset_overrides=QUIET, **simulation)


def test_table_turns_gravity_as_the_science_says(rng):
    outer, inner = rng.uniform(-3.0, 3.0, (2, 40))
    up = np.array([0.01, -0.02, 1.0])
    assert turn(up, outer, inner) == pytest.approx(force_from_angles(outer, inner, up), abs=1e-14)


@pytest.mark.parametrize("temperature", [23.0, 70.0])
def test_output_at_rest_is_what_the_truth_says(temperature):
    plant = plant_of(still(slot_gradient_K=0.0))
    write(plant, 3, "set_point", temperature)
    plant.advance(7_200_000_000)
    turn_to(plant, 60.0, 35.0)
    truth = plant.truth("U000")
    force = force_from_angles(np.radians(60.0), np.radians(35.0))
    theta = temperature - 25.0
    bias = truth.bias_g + theta * (truth.bias_tempco + theta * truth.bias_tempco_quadratic)
    scale = 1.0 + theta * (truth.scale_tempco + theta * truth.scale_tempco_quadratic)
    # a servo rests within some 0.0004° of its target, the air within 0.02 K of its set point: some 10 µg
    assert mean_counts(plant) / 256000.0 == pytest.approx(bias + scale * (truth.matrix @ force), abs=2.5e-5)


def test_gravity_of_the_place_scales_the_force_up_to_the_range():
    plants = [plant_of(still(local_gravity_m_s2=g)) for g in (9.78, 9.83)]
    near, far = (mean_counts(plant) for plant in plants)
    assert (far - near)[2] == pytest.approx(256000.0 * 0.05 / 9.80665, rel=0.02)
    preset = load_preset("ADXL355")  # codes end before the range of 8 g, at the scale of the table
    assert preset.full_scale == 2**19 - 1
    assert preset.full_scale / preset.scale == pytest.approx(2.048, abs=1e-4)
    assert mean_counts(plant_of(station_of(preset_overrides=QUIET | {"range_g": 0.5})))[2] == 128000.0  # clipped


def test_truth_of_a_unit_does_not_depend_on_slot_lot_or_repetition():
    alone = Lot(units=[Unit(serial="U002", slot=7)], device="ADXL355", seed=5)
    first, other, again = plant_of(), plant_of(lot=alone), plant_of(lot=lot_of(repeat=1))
    a, b, c = (plant.truth("U002") for plant in (first, other, again))
    assert np.array_equal(a.bias_g, b.bias_g)
    assert np.array_equal(a.misalignment, b.misalignment)
    assert not np.array_equal(a.slot_rotation, b.slot_rotation)
    assert np.array_equal(a.bias_g, c.bias_g)
    assert not np.array_equal(mean_counts(first), mean_counts(again))  # the noise is new


def test_analogue_device_sits_at_half_its_supply_and_follows_it():
    plant = plant_of(still(supply_spread=0.02, slot_rotation_mrad=0.0), lot_of(device="analogue"))
    truth = plant.truth("U000")
    assert truth.supply_ratio != 1.0
    plant.advance(60_000_000)
    volts = mean_counts(plant) * plant.preset.lsb
    nominal = 1.5 + 0.3 * (truth.bias_g[2] - 2.0 * truth.bias_tempco[2] + (1.0 + 1e-6 * truth.scale_ppm[2]))
    assert volts[2] == pytest.approx(truth.supply_ratio * nominal, rel=1e-3)
    seen = plant.supply_reading()[0]
    assert seen == pytest.approx(3.0 * truth.supply_ratio, abs=3e-4)


def test_move_keeps_its_speed_and_acceleration():
    move = Move(start=0.0, origin=10.0, target=100.0, rest=100.0, speed=30.0, acceleration=20.0)
    time = np.linspace(0.0, move.end, 4001)
    angle = move.angle(time)
    speed = np.gradient(angle, time)
    assert angle[-1] == pytest.approx(100.0, abs=1e-9)
    assert abs(speed).max() == pytest.approx(30.0, rel=1e-3)
    assert abs(np.gradient(speed, time)).max() <= 20.0 * 1.01


def test_axis_rings_and_settles_and_the_encoder_has_its_resolution():
    axis = Axis(seed=3, channel=10)
    axis.go(0.0, 45.0, 30.0, 30.0)
    end = axis.move.end
    ringing = axis.angle(np.linspace(end, end + 0.2, 50))
    assert 0.003 < abs(ringing - 45.0).max() < 0.02
    readings = np.array([axis.encoder(end + 5.0 + 0.001 * i) for i in range(200)])
    assert np.allclose(readings / 0.001, np.round(readings / 0.001), atol=1e-6)
    assert abs(readings.mean() - 45.0) < 0.002
    assert readings.std() > 0.0


def test_chamber_ramps_within_its_limit_overshoots_a_little_settles_and_shakes_more_while_it_cools():
    cold, warm = Chamber(room=23.0, ramp_K_min=3.0), Chamber(room=23.0, ramp_K_min=3.0)
    cold.set_point, warm.set_point = -20.0, 60.0
    air = []
    for second in range(3600):
        cold.step()
        warm.step()
        air.append(warm.air)
        assert second != 599 or cold.vibration() > 5.0 * warm.vibration()
    path = np.array(air)
    assert np.diff(path).max() * 60.0 < 5.0
    assert 60.1 < path.max() < 61.5
    assert abs(path[-600:] - 60.0).max() < 0.05


OF_THE_RESPONSE = {"gas_film", "softening_spring"}  # at rest they change nothing; test_sweep_in_its_air.py has them
AT_REST = sorted(set(HIDDEN) - OF_THE_RESPONSE)


def moved(*hidden):
    plant = plant_of(still(), lot_of(1), hidden=hidden)
    write(plant, 3, "set_point", 45.0)
    plant.advance(900_000_000)
    turn_to(plant, 50.0, 20.0)
    return mean_counts(plant)


plain = cache(moved)


NOTHING = {  # figures of an effect that is none; all others have a size
    "cubic_transfer": ("hardening",), "pendulous_mass": ("compliance",), "hysteresis_play": ("gain",),
    "element_lag": ("tempco",), "level_error": ("about_x", "about_y"), "vibration_rectification": ("coefficient",),
    "moisture_swelling": ("swelling",), "yielding_adhesive": ("gain", "scale"),
    "moisture_diffusion": ("swelling", "scale"), "leaky_lid": ("deflection", "scale"),
}  # fmt: skip
LARGE = {
    "step_change": {"at": 500.0},
    "vibration_rectification": {"coefficient": 1e7},
    "yielding_adhesive": {"assembly": 40.0},
    "creep": {"size": 5e-3, "tau": 60.0},
}


@pytest.mark.parametrize("kind", mostly_slow(AT_REST, *AT_REST[::4]))
def test_every_hidden_effect_moves_an_output_and_nothing_at_zero_size(kind):
    zero = dict.fromkeys(NOTHING.get(kind, ("size",)), 0.0)
    assert np.array_equal(plain(), moved(hidden_effect(kind, zero)))
    assert abs(plain() - moved(hidden_effect(kind, LARGE.get(kind, {})))).max() > 1.0


def test_refuses_what_does_not_exist_with_what_looks_like_it():
    with pytest.raises(RecipeInvalid, match="cubic_transfer"):
        hidden_effect("cubic_transfre", {})
    with pytest.raises(RecipeInvalid, match="hardening"):
        hidden_effect("cubic_transfer", {"hardnening": 1.0})
    with pytest.raises(RecipeInvalid, match="ADXL355"):
        load_preset("ADXL35")
    with pytest.raises(WrongUse, match="slot 8"):
        plant_of(lot=Lot(units=[Unit(serial="A", slot=8)], device="ADXL355"))


def test_relative_humidity_falls_in_warmed_air_as_the_table_of_saturation_says():
    """Saturation over water at 20 and 60 °C: 23.39 and 199.46 hPa (IAPWS, as in CRC Handbook, 6-5)."""
    moisture = Moisture(np.random.default_rng(1))
    time = np.zeros(3)
    cool, warm, frost = moisture.relative(time, np.array([20.0, 60.0, -10.0]))
    assert cool / warm == pytest.approx(199.46 / 23.39, rel=0.01)
    assert frost == 100.0


EVENTS = [
    Write(1, 2, 100, (1, 2, 3)),
    Injection(2, FaultOrder(kind="door", at_s=1.0)),
    LineOrder(3, 5, "SETP 25"),
    Write(4, 2, 101, (), "coil"),
    Write(5, 3, 7, (9,)),
    Injection(6, FaultOrder(kind="noise", serial="U001")),
]


def test_a_state_after_every_event_is_that_of_all_events_at_once() -> None:
    often, once = Journal("station"), Journal("station")
    for number, event in enumerate(EVENTS, start=1):
        often.add(event)
        assert len(json.loads(zlib.decompress(often.state(number)))["events"]) == number
        once.add(event)
    assert often.state(9) == once.state(9)
    assert once.recorded(often.state(9)) == (EVENTS, 9)
