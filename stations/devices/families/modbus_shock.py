"""Shock machines whose controller holds registers, with a triggered recorder that leaves a result file."""

from stations.devices.families import arm_release_shock


class ModbusShockMachine(arm_release_shock.ShockMachine):
    """Set, armed and released by registers; door, state and file are read as names and text."""

    on = 1
    off = 0
    now = 1
