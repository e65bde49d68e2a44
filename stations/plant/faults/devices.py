"""Faults of table, chamber and units with their memory, reader, sensors, emergency stop, test equipment, computer's clock."""

from typing import Any

from stations.plant.faults.base import AXES, UNIT, Effect, Fault, Kind, add, fault
from stations.plant.fixture import Chamber
from stations.plant.world import World


@fault(*AXES)
def backlash(fault: Fault, world: World, play_deg: float = 0.5) -> Effect:
    """A worn gear: the shaft lags the encoder by a play of ``play_deg``, on the side from which it moved."""
    fault.axis(world).play_deg = play_deg
    yield
    fault.axis(world).play_deg = 0.0


@fault(*AXES)
def lost_home(fault: Fault, world: World, offset_deg: float = 3.0, admitted: float = 1.0) -> Effect:
    """A drive loses its reference: its angles are wrong by ``offset_deg``; its home flag is 0 unless ``admitted`` is 0."""
    axis = fault.axis(world)
    axis.lose_zero(offset_deg)
    axis.homed = admitted == 0.0
    yield
    axis.lose_zero(-offset_deg)
    axis.homed = True


@fault(*AXES)
def stuck_encoder(fault: Fault, world: World) -> Effect:
    """An encoder repeats its last angle while the shaft turns."""
    axis = fault.axis(world)
    axis.stuck_at = axis.encoder(world.now)
    yield
    axis.stuck_at = None


@fault(*AXES)
def table_stall(fault: Fault, world: World) -> Effect:
    """An axis is blocked during its move; when it is released it continues to its target."""
    fault.axis(world).stall(world.now)
    yield
    fault.axis(world).release(world.now, resumes=True)


@fault()
def emergency_stop(fault: Fault, world: World) -> Effect:
    """The emergency stop is pressed: both axes stop and hold their positions."""
    world.emergency_stop = True
    for axis in (world.outer, world.inner):
        axis.stall(world.now)
    yield
    world.emergency_stop = False
    for axis in (world.outer, world.inner):
        axis.release(world.now, resumes=False)  # an interrupted move does not continue


def _chamber_has(world: World, attribute: str, value: Any) -> Effect:
    """Sets an attribute of the chamber, and afterwards what it is in a sound one."""
    setattr(world.fixture.chamber, attribute, value)
    yield
    setattr(world.fixture.chamber, attribute, getattr(Chamber, attribute))


@fault()
def chamber_overshoot(fault: Fault, world: World) -> Effect:
    """Integral wind-up: the controller integrates while its actuator is saturated, and the air overshoots the set point."""
    return _chamber_has(world, "winds_up", value=True)


@fault()
def chamber_power(fault: Fault, world: World) -> Effect:
    """The chamber loses the power for heating and cooling; its controller still answers."""
    return _chamber_has(world, "powered", value=False)


@fault()
def chamber_unsettled(fault: Fault, world: World, swing_K: float = 6.0, period_s: float = 900.0) -> Effect:  # noqa: N803
    """The controller hunts: its working set point oscillates by ±``swing_K`` with a period of ``period_s``."""
    return _chamber_has(world, "hunting", (swing_K, period_s))


@fault()
def door(fault: Fault, world: World) -> Effect:
    """The chamber's door is opened."""
    return _chamber_has(world, "door_open", value=True)


@fault()
def vibration(fault: Fault, world: World, rms_g: float = 0.02) -> Effect:
    """External vibration of the fixture, ``rms_g`` g rms: a fork-lift, a press nearby."""
    return _chamber_has(world, "shaken_g", rms_g)


@fault()
def clock_jump(fault: Fault, world: World, step_s: float = 30.0) -> None:
    """The clock of the computer that drives the station jumps by ``step_s`` seconds."""
    world.clock_offset_s += step_s


@fault(UNIT)
def dead(fault: Fault, world: World) -> Effect:
    """The outputs of a unit stay at their last count."""
    world.physics.dead_from[fault.unit] = fault.order.at_s
    yield
    world.physics.dead_from[fault.unit] = float("inf")


@fault()
def dropped_samples(fault: Fault, world: World, samples: float = 5.0, numbered: float = 1.0) -> None:
    """The reader loses ``samples``: the sample numbers show the gap unless ``numbered`` is 0; the count always does."""
    world.sampler.lose(int(samples), numbered=numbered != 0.0)


@fault(UNIT)
def fifo_overflow(fault: Fault, world: World) -> None:
    """The memory of a unit overflows once: samples that were not read yet are overwritten."""
    world.sampler.overrun(fault.unit)


@fault(UNIT, "chamber", "reader")
def frozen_temperature(fault: Fault, world: World) -> Effect:
    """A thermometer repeats its last reading: that of a unit, of the chamber, or all of the reader's."""
    if fault.order.device == "chamber":
        world.frozen_air_C = world.air_reading()
    else:
        readings = world.temperature_reading()
        slots = [world.slots[fault.unit]] if fault.order.serial else range(len(readings))
        world.frozen_slots_C |= {slot: readings[slot] for slot in slots}
    yield
    world.frozen_air_C = None
    world.frozen_slots_C.clear()


@fault(UNIT, "reader")
def supply_sag(fault: Fault, world: World, part: float = 0.1) -> Effect:
    """The supply of a unit, or of all, falls by the fraction ``part``; ratiometric outputs fall with it, others shift."""
    units = [fault.unit] if fault.order.serial else list(range(len(world.slots)))
    world.scale_supply(units, 1.0 - part)
    yield
    world.scale_supply(units, 1.0)


@fault(UNIT)
def swapped_slots(fault: Fault, world: World) -> Effect:
    """A unit and the next unit of the lot are exchanged: each slot has the other's serial number and samples."""
    unit, other, seats = fault.unit, (fault.unit + 1) % len(world.serials), world.seats
    seats[unit], seats[other] = seats[other], seats[unit]
    yield
    seats[unit], seats[other] = seats[other], seats[unit]


@fault(UNIT)
def memory_bad_block(fault: Fault, world: World, copy: float = 0.0, word: float = 40.0) -> Effect:
    """A word of a unit's memory no longer keeps some bits: word ``word`` of copy A (``copy`` 0) or B (1)."""
    stuck = world.flash[fault.unit].stuck
    stuck[int(copy), int(word)] = 0xFF00
    yield
    stuck.clear()


@fault(UNIT)
def memory_power_lost(fault: Fault, world: World, after_s: float = 0.45) -> None:
    """The supply of the devices fails for a second, ``after_s`` after the next command to program the unit's memory."""
    world.flash[fault.unit].lose_power_s = after_s


@fault(UNIT)
def memory_worn(fault: Fault, world: World, left: float = 0.0) -> None:
    """The memory of a unit has ``left`` of its specified erasures left."""
    flash = world.flash[fault.unit]
    flash.erases = [flash.endurance - int(left)] * 2


CONDITIONS = {
    "missed_trigger": "The recorder misses its trigger: the test leaves no recording.",
    "clipped_reference": "The conditioner of the reference sensor clips.",
    "controller_abort": "The controller aborts every test: its interlock is open.",
    "level_not_reached": "The exciter reaches a third of its level, the shock machine a third of its peak.",
    "guard_door": "The guard door of shock machine or centrifuge is open: it does not start, and stops.",
    "overspeed": "The centrifuge's speed monitor trips.",
    "current_limit": "The current limit of the power supply holds a raised voltage a tenth too low.",
    "reference_cable_off": "The cable of the reference sensor on the exciter or shock machine is loose: its channel shows "
    "noise alone.",
    "drive_runaway": "The drive of the centrifuge turns half as fast again as it is told, and its speed monitor does not trip.",
}
"""Conditions of the bench, for which the simulated controllers look."""


def _condition(fault: Fault, world: World) -> Effect:
    world.bench.conditions.add(fault.kind.name)
    yield
    world.bench.conditions.discard(fault.kind.name)


add(*(Kind(name, meaning, effect=_condition) for name, meaning in CONDITIONS.items()))


@fault(UNIT)
def cable_off(fault: Fault, world: World) -> Effect:
    """The cable of a unit on the test equipment is off: noise alone is recorded."""
    world.bench.cable_off.add(fault.unit)
    yield
    world.bench.cable_off.discard(fault.unit)
