"""Shock machines whose controller holds registers, with a triggered recorder that leaves a result file."""

from typing import ClassVar

from stations.devices.families import arm_release_shock


class ModbusShockMachine(arm_release_shock.ShockMachine):
    """Set, armed and released by registers; door, state and file are read as names and text."""

    needs: ClassVar[tuple[str, ...]] = arm_release_shock.ShockMachine.needs
    on: ClassVar[str | int] = 1
    off: ClassVar[str | int] = 0
    now: ClassVar[str | int] = 1
