"""The world table: worlds that nobody prepared, each with the verdict that a diagnosis has to give.

The generators share nothing with the estimator. Rows with ``fast`` are part of every run of the tests.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import world_changes as changes
from made_worlds import HIDDEN, NOISES, NULLS, RAMP_HIDDEN, RAMP_NULLS, Noise, World
from world_row import Case, Hand, Recording, Row, Strange

# found by way of the worlds
from continued_run import SCENES  # isort: skip
from physics import OUTSIDE  # isort: skip
from tables import FAULTS  # isort: skip

SEED = 5_500_000
OWN_NOISE, LARGE, SLIPS = 5_900_000, 6_200_000, 6_100_000
SWAPS, POSES, JUMPS = 6_300_000, 6_400_000, 6_500_000
CLOCKS = frozenset({"time_s", "since_power_s"})
HEAT = CLOCKS | {"unit_C", "chamber_C"}
physical, handled = partial(Row, physics=True), partial(Row, recommended=())
LOUD_SLIP = World(units=1, noise=Noise(white=25.0, flicker=30.0), fault="table_slip", amount=0.35)


def rows() -> Iterator[Row]:
    """Every row: first without anything hidden, then faults, then physics."""
    walk = World(units=2, poses=12, hidden=(("third_order", 0.2),), noise=Noise(walk=4.0))
    yield Row(NULLS["K8"], SEED, "K8", first=(), adequate=(True,), also=changes.walk_is_known, fast=True)
    yield physical(
        walk, 41_000_007, "cubic under a walk", named=("third_order",), adequate=(False,), also=changes.small_and_seen
    )
    for name in sorted(set(NULLS) - {"lsb5", "many_units"}):
        for seed in (SEED + 1, SEED + 2):
            yield Row(NULLS[name], seed, name, first=())
    for seed in (SEED, *range(SEED + 10, SEED + 14)):
        yield Row(NULLS["t3"], seed, "t3", first=(), also=changes.tails_are_listed if seed == SEED else None)
    yield Row(NULLS["lsb5"], SEED, "lsb5", blocked=("quantised",), fast=True)
    yield Row(
        replace(NULLS["lsb5"], units=2), SEED, "lsb5 in all", adequate=(None,), also=changes.reason_names_every_unit
    )
    for name in ("telegraph_200s", "telegraph_900s", "telegraph_3000s", "telegraph_two_units"):
        for seed in range(3):
            yield Row(NOISES[name], OWN_NOISE + 60 + seed, name)
    for name in ("telegraph_3000s", "telegraph_900s"):
        for seed in range(2):
            yield Row(NOISES[name], JUMPS + 10 + seed, name)
    yield from rows_of_dwells_and_poses()
    yield from rows_of_handling()
    yield from rows_of_single_axes()
    yield from rows_of_steps()
    yield from rows_of_physics()
    yield from rows_of_what_is_left_over()
    yield from rows_of_other_generators()


def rows_of_dwells_and_poses() -> Iterator[Row]:
    yield handled(
        FAULTS["dwell_0.5mg"], SEED, "dwell_0.5mg", first=("bad_dwell",), alone=True, told="dwells", adequate=(False,),
        also=changes.carried_by_the_dwell, fast=True,
    )  # fmt: skip
    for units in (1, 2):
        for amount in (0.5, 2.0, 5.0):
            world = World(units=units, fault="bad_dwell", amount=amount)
            yield Row(
                world, POSES + 10, f"dwell {amount:g} mg of {units}", first=("bad_dwell",), alone=True, told="dwells"
            )
    yield Row(
        World(units=1), POSES + 20, "two dwells of a pose", first=("bad_dwell", "bad_dwell"), alone=True,
        also=changes.of_the_pose, change=changes.two_dwells_of_a_pose,
    )  # fmt: skip
    yield Row(
        FAULTS["pose_2deg"], SEED, "pose_2deg", named=("wrong_pose",), told="dwells",
        also=lambda document, _: document["blocked_by"] == [],
    )  # fmt: skip
    for degrees in (0.1, 2.0, 20.0):
        world = World(fault="wrong_pose", amount=degrees)
        yield Row(world, POSES + 70, f"pose off {degrees:g}°", first=("wrong_pose",), told="dwells")
    for name, first in (("pose_2deg", "wrong_pose"), ("pose_off_one_unit", "pose_off")):
        yield handled(
            FAULTS[name], POSES + 1, f"{name} of stated forces", first=(first,), told="dwells", change=changes.stated_forces,
            fast=True,
        )  # fmt: skip
    for seed in (SEED + 5, SEED + 6, SEED + 7):
        yield handled(
            World(units=3), seed, "two units exchanged for a soak", change=changes.exchanged_for_a_soak,
            also=changes.exchange_is_told, fast=seed == SEED + 5,
        )  # fmt: skip
    for name in ("pose_off_one_unit", "pose_off_one_unit_12", "pose_off_two_units"):
        for seed in (1, 2, 3):
            yield handled(
                FAULTS[name], POSES + seed, name, first=("pose_off",), told="dwells", unexplained=frozenset(),
                fast=(name, seed) == ("pose_off_one_unit", 1),
            )  # fmt: skip


def rows_of_handling() -> Iterator[Row]:
    for name in sorted(set(FAULTS) - {"moved_one_unit"}):
        for seed in (SEED + 3, SEED + 4):
            yield Row(FAULTS[name], seed, name, told="names")
    yield physical(
        FAULTS["moved_0.2mrad"], SEED, "moved_0.2mrad", told="near", recommended=(),
        also=lambda document, _: "mrad about" in document["classes"][0]["evidence"], fast=True,
    )  # fmt: skip
    yield physical(
        FAULTS["thermometer_0.5K"], SEED, "thermometer_0.5K", named=("soak_thermometer",), recommended=(),
        also=changes.three_soaks_are_said,
    )  # fmt: skip
    yield handled(
        replace(FAULTS["unsoaked"], units=3), SEED, "unsoaked", named=("device_not_soaked",),
        also=changes.time_constant_is_right,
    )  # fmt: skip
    yield Row(
        replace(FAULTS["unit_unsoaked"], units=3), SEED, "unit_unsoaked", first=("unit_not_soaked",), told="units"
    )
    yield Row(
        replace(FAULTS["dwell_of_moved"], units=4), SEED, "dwell_of_moved", first=("unit_moved", "bad_dwell"), told="units",
        also=changes.both_faults_stand,
    )  # fmt: skip
    for fault, amount, seed, name in (
        ("unit_moved", 0.3, 1, "unit_moved"), ("unit_moved", 0.3, 3, "unit_moved"),
        ("unit_unsoaked", 0.0, 4, "unit_not_soaked"), ("table_slip", 0.3, 4, "table_slip"),
        ("wrong_pose", 0.1, 6, "wrong_pose"),
    ):  # fmt: skip
        world = World(units=40, poses=12, fault=fault, amount=amount)
        yield handled(world, LARGE + seed, f"{name} of 40", first=(name,), alone=True, told="dwells")
    for soaks, poses in (((-10.0, 25.0, 60.0), 24), ((-10.0, 25.0, 60.0), 12), ((22.0,), 24)):
        for seed in (2, 3):
            world = replace(LOUD_SLIP, soaks=soaks, poses=poses)
            yield handled(
                world, SLIPS + seed, f"slip of one {poses}, {len(soaks)}", first=("table_slip",), told="dwells"
            )
    for seed in (2, 3):
        world = replace(LOUD_SLIP, fault="unit_moved", amount=0.5)
        yield physical(world, SLIPS + seed, "one unit moved", first=("unit_moved",), told="dwells")
        yield physical(
            FAULTS["slip_and_moved"], POSES + 18 + seed, "slip_and_moved", first=("table_slip", "unit_moved"), told="units",
        )  # fmt: skip
        world = World(fault="unit_moved", amount=0.5, beside=(("unit_moved", 0.5),))
        yield physical(world, POSES + 28 + seed, "two moved", told="units", unexplained=frozenset())
    yield from rows_of_exchanges()


def rows_of_exchanges() -> Iterator[Row]:
    names = ("swapped", "swapped_thermometers", "swapped_alike", "swapped_two_units")
    seeds = [(name, seed) for name in names for seed in (1, 2)]
    for name, seed in (*seeds, ("swapped", 3), ("swapped_two_units", 700_002), ("swapped_many_units", 1)):
        yield handled(
            FAULTS[name], SWAPS + seed, name, first=("units_swapped",), alone=True, told="units", unexplained=frozenset(),
            also=changes.from_one_dwell, fast=(name, seed) == ("swapped_two_units", 1),
        )  # fmt: skip
    yield physical(FAULTS["swapped"], SWAPS + 5, "swapped back", also=changes.noise_of_the_lot)
    world = World(differ=0.4, fault="units_swapped")
    yield physical(
        world, SWAPS + 112, "swapped apart", first=("units_swapped",), alone=True, told="units",
        also=lambda document, _: document["blocked_by"] == [],
    )  # fmt: skip
    world = World(units=4, differ=0.2)
    yield physical(world, SWAPS + 30, "half exchanged", also=changes.not_exchanged, change=changes.half_exchanged)


def rows_of_single_axes() -> Iterator[Row]:
    for units in (1, 4):
        yield Row(
            World(units=units), OWN_NOISE + 80, f"jump of one of {units}", named=("bias_jump",),
            also=changes.jump_has_place_and_size, change=changes.last_unit_jumps,
        )  # fmt: skip
    middle = changes.in_middle_soak((3, "x", 600e-6))
    yield Row(World(units=6), OWN_NOISE + 90, "another bias in one soak", also=changes.some_unsteady, change=middle)
    for rate in (1800.0, 4000.0):
        yield physical(
            World(units=6, noise=Noise(flicker=10.0)), OWN_NOISE + 95, f"scale drifts, {rate:g} s", adequate=(False,),
            unexplained=CLOCKS, also=changes.no_reference_step, change=changes.drifting_scale(rate),
        )  # fmt: skip
    for axes in ((((1, "y"), (5, "y"))), ((0, "x"), (3, "z"), (6, "y"))):
        yield Row(
            World(), JUMPS + 1, f"{len(axes)} unsteady axes",
            also=changes.unsteady(*(f"W{unit + 1:03d}" for unit, _ in axes)),
            change=changes.in_middle_soak(*((unit, axis, 500e-6) for unit, axis in axes)),
        )  # fmt: skip
    yield Row(World(units=1), JUMPS + 2, "up and down", also=changes.jumps_are_told, change=changes.telegraph)
    sizes = np.random.default_rng(3).uniform(0.7, 1.3, (8, 3))
    for label, chosen in (
        ("y of all", [(unit, 1) for unit in range(8)]),
        ("all of one", [(4, axis) for axis in range(3)]),
    ):
        change = changes.in_middle_soak(
            *((unit, "xyz"[axis], 900e-6 * float(sizes[unit, axis])) for unit, axis in chosen)
        )
        # of one unit, in three soaks, a step and a slope are the same columns; the step is named alone
        missed = "" if label == "y of all" else "a step of the unit is named, and not that a curve explains it as well"
        yield physical(
            World(), JUMPS + 3, f"curve, {label}", named=("bias_temperature_quadratic",), change=change, not_reached=missed,
        )  # fmt: skip


def rows_of_steps() -> Iterator[Row]:
    """A bias that jumps between two dwells of a long run is placed in the right gap, and leaves no dwell to another cause."""
    noise = Noise(white=25.0, flicker=30.0)
    world = World(units=4, poses=48, noise=noise)
    for dwell in (72, 79):
        yield physical(
            world, OWN_NOISE + 2, f"step before {dwell}", first=("step_change",), also=changes.step_before(dwell),
            change=changes.jumping(dwell, 2),
        )  # fmt: skip
    yield physical(
        world, OWN_NOISE + 2, "pose missed after a step", named=("step_change",), also=changes.pose_missed_at_the_step,
        change=changes.jumping_and_turned,
    )  # fmt: skip
    for dwell, seed in ((37, 4), (37, 5), (44, 3), (44, 4), (44, 5)):
        # without the dwells before it every instant between their neighbours is as good: it had stood there and kept them bad
        yield physical(
            World(units=1, noise=noise), OWN_NOISE + seed, f"step of one unit before {dwell}", first=("step_change",),
            also=changes.no_dwell_is_removed, change=changes.jumping(dwell, seed, 600.0),
        )  # fmt: skip
    for units in (1, 2):
        for seed in (3, 4, 7):
            yield physical(
                World(units=units, noise=noise), 5_700_000 + seed, f"gain step of one of {units}", named=("gain_step",),
                also=changes.gain_step_is_certain, change=changes.last_unit_amplifies,
            )  # fmt: skip


def rows_of_what_is_left_over() -> Iterator[Row]:
    for index, driver, missed in ((26, "supply_V", "a wrong pose is told beside the supply"), (14, "vibration_g", "")):
        yield Row(
            Case("withheld", index), 9931, f"poses and {driver}", first=(), unexplained=frozenset({driver}),
            not_reached=missed,
        )  # fmt: skip
    for index, effect in ((199, "pose_hysteresis"), (32, "creep_after_move")):
        yield physical(
            Case("lot8_size1", index), 77_002, f"{effect} from before the run", first=(effect,), recommended=(effect,),
            unexplained=frozenset(),
        )  # fmt: skip
    # of eight dwells a curve takes so much of the freedom that the deviance falls: six of ten such lots were not adequate by it
    few = World(units=3, poses=8, soaks=(25.0,), noise=Noise(flicker=300.0))
    for seed in (3, 6, 7, 16):
        yield Row(few, seed, "eight dwells", first=(), adequate=(True,), unexplained=frozenset(), fast=seed == 6)
    yield Row(Strange("clicks"), 282_526_000, "clicks", first=(), adequate=(False,), unexplained=frozenset({"time_s"}))
    yield physical(
        Case("lot8_size2", 2), 77_001, "hysteresis in shuffled soaks", named=("thermal_hysteresis",),
        unexplained=frozenset(),
    )  # fmt: skip


def rows_of_physics() -> Iterator[Row]:
    world = World(units=4, poses=6, soaks=(25.0, 60.0, -10.0, 20.0), hidden=(("thermal_hysteresis", 4.0),))
    yield physical(world, SEED, "hysteresis", also=changes.step_with_hysteresis)
    for scene in ("creep on faces", "creep on faces, shuffled"):
        # the table turned before the first dwell: the state of the creep there is unknown, and looks like a warm-up of
        # seconds; its way from face to face leads through other directions, which looks like a product of two forces
        yield physical(SCENES[scene], SEED, scene, first=("creep_after_move",), alone=True, unexplained=frozenset())
    yield physical(HIDDEN["adc_nonlinearity_5"], SEED, "adc_nonlinearity_5", first=("adc_nonlinearity",), alone=True)
    world = World(units=4, hidden=(("third_order", 2.0),))
    yield physical(world, SEED, "cubic", recommended=("third_order",), also=changes.verdict_is_carried, fast=True)
    for index in (0, 2):
        yield physical(Case("covariate_curve", index), 8080, "humidity", unexplained=frozenset({"humidity_pct"}))
    for name in ("ramps_B300", "ramps_K4"):
        yield Row(RAMP_NULLS[name], SEED, name, first=(), adequate=(True,))
    for name in ("thermal_lag", "thermal_hysteresis", "third_order"):
        yield physical(RAMP_HIDDEN[f"ramps_{name}"], SEED, f"ramps_{name}", named=(name,))
    yield Row(Case("withheld", 4), 8080, "brownout", first=(), unexplained=frozenset({"supply_V"}))
    nine = World(units=8, soaks=(-30.0, -15.0, 0.0, 10.0, 25.0, 35.0, 45.0, 55.0, 65.0), noise=Noise(flicker=0.0))
    small = replace(nine, hidden=(("third_order", 0.16),))
    yield physical(
        small, 53, "small cubic", named=("third_order",), adequate=(False,), recommended=("third_order",),
        unexplained=frozenset(),
    )  # fmt: skip
    yield Row(nine, 54, "nothing of many dwells", first=(), adequate=(True,), unexplained=frozenset())
    for index, seed, driver in ((5, 771, "time_s"), (12, 771, "time_s"), (11, 771, "since_move_s")):
        yield Row(
            Case("withheld", index), seed, f"{driver} in the noise", first=(), adequate=(False,),
            unexplained=frozenset({driver}),
        )  # fmt: skip
    for fault, seed in (("unit_moved", 930_004), ("wrong_pose", 930_008)):
        world = World(hidden=(("scale_warms_up", 2.0),), fault=fault, amount=0.5)
        yield physical(world, seed, f"{fault} and unknown", told="names", adequate=(False,))
    for name in ("misalignment_and_moved", "misalignment_and_slip"):
        yield physical(
            HIDDEN[name], SEED, name, named=("misalignment_temperature",), told="names",
            recommended=("misalignment_temperature",), also=changes.left_out_dwells_judge,
        )  # fmt: skip
    world = World(units=3, hidden=(("cross_coupling", 2.0),))
    yield physical(
        world, SEED, "late and with gaps", first=("cross_coupling",), alone=True, change=changes.late_and_with_gaps
    )
    for name in OUTSIDE:
        yield Row(
            World(hidden=((name, 2.0),)), POSES + 1, f"outside {name}", adequate=(False,), unexplained=HEAT,
            also=changes.noise_beside_the_dependence,
        )  # fmt: skip
    for name in ("fixture_bends", "axes_bend_with_heat", "cubic_with_heat"):
        yield physical(World(hidden=((name, 8.0),)), POSES + 2, f"large {name}", adequate=(False,))


def rows_of_other_generators() -> Iterator[Row]:
    """Sensor, station or handling, and what is recommended, in lots whose makers know nothing of the judge."""
    pivot = Case("lot8_size1", 40)
    yield physical(pivot, 5150, "pivot that sticks", also=changes.pivot_is_in_the_class)
    for index, effect in ((39, "backlash"), (35, "pose_hysteresis")):
        yield physical(
            Case("lot8_size2", index), 5150, effect, first=(effect,), alone=True, recommended=(effect,),
            also=changes.memory_is_judged_on_dwells_left_out,
        )  # fmt: skip
    for seed in (95_001, 5_950_001):
        also = changes.told_with_its_bias_and_without_physics
        yield physical(Strange("unit_seated_again", 20.0), seed, "seated again", also=also)
    for seed in (420_004, 420_006):
        also = changes.linear_coefficients_are_named
        yield physical(Strange("null"), seed, "one temperature that wanders", also=also)
    for seed in (98_000_003, 98_000_007):
        grows = Strange("grows_with_force")
        yield Row(grows, seed, "noise along gravity", first=(), unexplained=frozenset(), fast=seed == 98_000_003)
    # what the table passes on its way drags friction along; the legs of its base are an hour behind the chamber
    for seed in (99_100_001, 99_100_007):
        yield physical(Strange("friction_in_bearing"), seed, "friction on the way", first=("pose_hysteresis",))
    for seed in (99_100_007, 99_100_009):
        yield physical(Strange("base_tilts"), seed, "late base", first=("base_tilts",))
    for seed in (99_200_002, 99_200_003):
        slips, early = Strange("encoder_slips", 20.0), Strange("soak_too_early", 20.0)
        yield Row(slips, seed, "slips under load", first=("slips_under_load",), unexplained=frozenset())
        yield Row(early, seed + 100_000, "soak too early", first=("soak_too_early",), unexplained=frozenset())
    also = changes.may_be_of_the_station
    missed = "an offset of the encoder is named beside two poses that are off, in place of the slip"
    yield physical(Strange("encoder_slips", 20.0), 95_001, "encoder slips", also=also, not_reached=missed)
    for world in (*map(Hand, ("warm_up", "temperature_curve", "lag", "cubic")), Hand("friction", rests=True)):
        missed = (
            "of the class the fifth order leads by more than 4, and is recommended" if world.effect == "cubic" else ""
        )
        also = changes.right_of(world.effect)
        yield physical(world, 77, f"{world.effect} by hand", also=also, not_reached=missed)
    yield physical(Hand("friction"), 77, "friction without rests by hand", named=("thermal_hysteresis",))
    warm = Recording(40, "white 280, B 30", warm_up=2000.0)
    for seed in (5_150_006, 5_150_012):
        yield physical(warm, seed, "warm-up", named=("warm_up",), also=changes.one_class_is_named)
    bad = Recording(24, "white 25, B 30", bad=1, bad_ug=5000.0)
    also = changes.bad_dwell_is_the_spoilt_one
    yield Row(bad, 5_150_002, "no warm-up", first=("bad_dwell",), alone=True, also=also)
    yield physical(Strange("sticking_pivot", 6.0), 12, "sticking pivot", also=changes.pose_is_the_driver)
