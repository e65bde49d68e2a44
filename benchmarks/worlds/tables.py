"""The worlds of each table, by name."""

from __future__ import annotations

from dataclasses import replace

import physics
from noise import Noise
from world import World

PLAIN = Noise()
NULLS: dict[str, World] = {
    "B30": World(),
    "K2": World(noise=Noise(walk=2.0)),
    "K4": World(noise=Noise(walk=4.0)),
    "K8": World(noise=Noise(walk=8.0)),
    "K4_one_unit": World(units=1, noise=Noise(walk=4.0)),
    "K4_two_units": World(units=2, noise=Noise(walk=4.0)),
    "white": World(noise=Noise(flicker=0.0)),
    "B300": World(noise=Noise(flicker=300.0)),
    "one_unit": World(units=1),
    "two_units": World(units=2),
    "many_units": World(units=32),
    "one_unit_x3": World(noise=Noise(unit_factors=(3.0, *[1.0] * 7))),
    "axis_x3": World(noise=Noise(axis_factors=(1.0, 1.0, 3.0))),
    "axis_x1.5": World(noise=Noise(axis_factors=(1.0, 1.0, 1.5))),
    "units_spread": World(noise=Noise(unit_factors=(0.5, 2.0, 1.0, 0.7, 1.4, 0.6, 1.7, 1.0))),
    "one_unit_white_x12": World(noise=Noise(unit_white=(12.0, *[1.0] * 7))),
    "one_unit_slow_x3": World(noise=Noise(unit_slow=(3.0, *[1.0] * 7))),
    "axis_slow_x3": World(noise=Noise(axis_slow=(1.0, 1.0, 3.0))),
    "units_slow_spread": World(noise=Noise(unit_slow=(0.5, 2.0, 1.0, 0.7, 1.4, 0.6, 1.7, 1.0))),
    "t3": World(noise=Noise(white=100.0, tails=3)),
    "t3_one_unit": World(units=1, noise=Noise(white=100.0, tails=3)),
    "t3_two_units": World(units=2, noise=Noise(white=100.0, tails=3)),
    "t5": World(noise=Noise(white=200.0, tails=5)),
    "lengths": World(durations=(2.0, 60.0)),
    "rest20": World(rest=20.0),
    "lsb5": World(noise=Noise(white=50.0, flicker=5.0), lsb=5.0),
}
NOISES: dict[str, World] = {
    "hot_x2": World(noise=Noise(hot=100.0)),
    "hot_x4": World(noise=Noise(hot=50.0)),
    "hot_x4_one_unit": World(units=1, noise=Noise(hot=50.0)),
    "hot_white_x4": World(noise=Noise(white=150.0, flicker=10.0, hot=50.0)),
    "telegraph_200s": World(noise=Noise(telegraph=(150.0, 200.0, 0.3))),
    "telegraph_900s": World(noise=Noise(telegraph=(150.0, 900.0, 0.3))),
    "telegraph_3000s": World(noise=Noise(telegraph=(150.0, 3000.0, 0.3))),
    "telegraph_two_units": World(units=2, noise=Noise(telegraph=(150.0, 900.0, 0.5))),
}
"""Noise that differs within a run: louder in the heat, or axes that jump between two levels, which is told as a jump."""

FAULTS: dict[str, World] = {
    "dwell_0.3mg": World(fault="bad_dwell", amount=0.3),
    "dwell_0.5mg": World(fault="bad_dwell", amount=0.5),
    "dwell_2mg": World(fault="bad_dwell", amount=2.0),
    "dwell_5mg": World(fault="bad_dwell", amount=5.0),
    "moved_0.2mrad": World(fault="unit_moved", amount=0.2),
    "thermometer_0.5K": World(fault="thermometer", amount=0.5),
    "pose_2deg": World(fault="wrong_pose", amount=2.0),
    "pose_0.1deg": World(fault="wrong_pose", amount=0.1),
    "slip_0.2mrad": World(fault="table_slip", amount=0.2),
    "unsoaked": World(fault="unsoaked"),
    "moved_one_unit": World(units=1, fault="unit_moved", amount=0.2),
    "dwell_one_unit": World(units=1, fault="bad_dwell", amount=0.5),
}
FAULTS |= {
    "unit_unsoaked": World(fault="unit_unsoaked"),
    "unsoaked_K4": World(fault="unsoaked", noise=Noise(walk=4.0)),
    "unsoaked_one_unit": World(units=1, fault="unsoaked"),
    "two_dwells_1mg": World(fault="two_dwells", amount=1.0),
    "dwell_and_moved": World(fault="bad_dwell", amount=1.0, beside=(("unit_moved", 0.2),)),
    "dwell_of_moved": World(fault="dwell_of_moved", amount=1.0),
    "dwell_and_pose": World(fault="bad_dwell", amount=1.0, beside=(("wrong_pose", 0.1),)),
    "dwell_and_thermometer": World(fault="bad_dwell", amount=1.0, beside=(("thermometer", 0.5),)),
    "moved_and_thermometer": World(fault="unit_moved", amount=0.2, beside=(("thermometer", 0.5),)),
    "slip_and_moved": World(fault="table_slip", amount=0.7, beside=(("unit_moved", 0.5),)),
    "pose_and_moved": World(fault="wrong_pose", amount=0.1, beside=(("unit_moved", 0.2),)),
    "pose_off": World(fault="pose_off", amount=0.1),
    "pose_off_one_unit": World(units=1, fault="pose_off", amount=0.1),
    "pose_off_one_unit_12": World(units=1, poses=12, fault="pose_off", amount=0.1),
    "pose_off_two_units": World(units=2, fault="pose_off", amount=0.1),
    "swapped": World(differ=0.2, fault="units_swapped"),
    "swapped_thermometers": World(differ=0.2, fault="units_swapped", amount=1.0),
    "swapped_alike": World(differ=0.02, fault="units_swapped"),
    "swapped_two_units": World(units=2, differ=0.2, fault="units_swapped"),
    "swapped_many_units": World(units=32, differ=0.2, fault="units_swapped"),
}
"""What goes wrong, one at a time and two at once."""

SMALL: dict[str, World] = {
    "dwell_5sd": World(fault="bad_dwell", floors=5.0),
    "dwell_5sd_white": World(fault="bad_dwell", floors=5.0, noise=Noise(white=100.0, flicker=0.0)),
    "dwell_7sd": World(fault="bad_dwell", floors=7.0),
    "dwell_5sd_one_unit": World(units=1, fault="bad_dwell", floors=5.0),
}
"""Dwells so little off that some of them cannot be told from noise."""

_HIDDEN = (
    "third_order", "second_order", "cross_coupling", "bias_temperature_quadratic", "scale_temperature_quadratic",
    "misalignment_temperature", "aging_linear", "warm_up", "step_change", "level_error",
)  # fmt: skip
HIDDEN: dict[str, World] = {
    f"{name}_{size:g}": World(hidden=((name, size),)) for size in (1.0, 2.0) for name in _HIDDEN
}
HIDDEN |= {
    f"{name}_2_K4": World(hidden=((name, 2.0),), noise=Noise(walk=4.0)) for name in ("third_order", "cross_coupling")
}
HIDDEN |= {f"{name}_2_one_unit": World(units=1, hidden=((name, 2.0),)) for name in ("third_order", "cross_coupling")}
HIDDEN |= {f"adc_nonlinearity_{size:g}": World(hidden=(("adc_nonlinearity", size),)) for size in (1.0, 2.0, 5.0)}
HIDDEN["third_order_and_dwell"] = World(hidden=(("third_order", 2.0),), fault="bad_dwell", amount=1.0)
HIDDEN["cubic_and_moved"] = World(hidden=(("third_order", 2.0),), fault="unit_moved", amount=0.3)
HIDDEN |= {
    f"misalignment_and_{name}": World(hidden=(("misalignment_temperature", 2.0),), fault=fault, amount=1.0)
    for name, fault in (("moved", "unit_moved"), ("slip", "table_slip"))
}
OUTSIDE = {f"{name}_{size:g}": World(hidden=((name, size),)) for size in (1.0, 2.0, 5.0) for name in physics.OUTSIDE}
OUTSIDE |= {f"{name}_2_two_units": World(units=2, hidden=((name, 2.0),)) for name in physics.OUTSIDE}
"""Physics outside the catalogue: to be told unexplained, with what it follows, and no effect or fault in its place."""
_RAMPS = World(soaks=(-10.0, 60.0, -10.0), repeats=3, durations=(6.0, 6.0), ramps=True)
RAMP_NULLS: dict[str, World] = {
    f"ramps_{name}": replace(_RAMPS, noise=noise, units=units)
    for name, noise, units in (
        ("B30", PLAIN, 8), ("K4", Noise(walk=4.0), 8), ("B300", Noise(flicker=300.0), 8), ("white", Noise(flicker=0.0), 8),
        ("t3", Noise(white=100.0, tails=3), 8), ("one_unit", PLAIN, 1),
    )
}  # fmt: skip
RAMP_HIDDEN: dict[str, World] = {
    f"ramps_{name}": replace(_RAMPS, hidden=((name, 2.0),))
    for name in (
        "third_order", "cross_coupling", "bias_temperature_quadratic", "scale_temperature_quadratic", "thermal_kink",
        "thermal_hysteresis", "thermal_lag", "thermal_rate", "misalignment_temperature", "level_error",
    )
}  # fmt: skip
"""Without soaks: dwells at three ramps of the chamber, from a room."""

TABLES = {"outside": OUTSIDE, "nulls": NULLS, "noises": NOISES, "faults": FAULTS, "small": SMALL, "hidden": HIDDEN}
TABLES |= {"ramp_nulls": RAMP_NULLS, "ramp_hidden": RAMP_HIDDEN}
WRONG = (
    "bias_temperature_quadratic", "scale_temperature_quadratic", "aging_linear", "aging_log", "step_change", "warm_up",
    "thermal_hysteresis", "third_order", "cross_coupling",
)  # fmt: skip
"""Effects that are put into the model of a run in which they are not."""

RIGHT = ("third_order", "cross_coupling", "second_order", "bias_temperature_quadratic", "misalignment_temperature")
LOOP: dict[str, World] = {
    "B30": World(),
    "K4": World(noise=Noise(walk=4.0)),
    "one_unit": World(units=1),
    "one_unit_K4": World(units=1, noise=Noise(walk=4.0)),
    "turn_on_300": World(turn_on=300.0),
    "B30_then_K4": World(fresh_noise=Noise(walk=4.0)),
    "B30_then_K8": World(fresh_noise=Noise(walk=8.0)),
    "K4_then_B30": World(noise=Noise(walk=4.0), fresh_noise=Noise()),
    "one_unit_B30_then_K4": World(units=1, fresh_noise=Noise(walk=4.0)),
    "one_unit_K4_then_B30": World(units=1, noise=Noise(walk=4.0), fresh_noise=Noise()),
}
