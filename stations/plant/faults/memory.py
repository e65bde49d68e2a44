"""Faults of the memory of a unit."""

from stations.plant.faults.base import UNIT, Effect, Fault, fault
from stations.plant.world import World


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
