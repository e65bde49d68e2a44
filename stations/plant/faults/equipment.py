"""Faults of test equipment: exciter, shock machine and centrifuge with their recorder."""

from stations.plant.faults.base import UNIT, Effect, Fault, Kind, add, fault
from stations.plant.world import World

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
