"""The supply of the devices while their memories are written: off and on again, never against the safety of the station."""

from schemas.errors import OperatorNeeded
from stations.safety.suspenders import require_released
from stations.station import Station

OFF_S, BOOT_S = 2.0, 1.0


def require_safe(station: Station, door_closed: bool) -> None:  # noqa: FBT001 - the station's rule
    """Ends the programming where the lease is lost, the emergency stop is pressed or the door is open."""
    station.require()
    guarded = station.reader.guarded()
    require_released(guarded)
    if door_closed and guarded.door_open:
        raise OperatorNeeded("station: the chamber's door is open, closed is needed; close it and repeat the command")


def power_cycle(station: Station, door_closed: bool) -> None:  # noqa: FBT001 - the station's rule
    """Every device without power for a while, and booted again."""
    reader, clock = station.reader, station.clock
    reader.require_switch()
    require_safe(station, door_closed)
    reader.switch("off")
    try:
        clock.sleep(OFF_S)
    finally:
        reader.switch("on")
    clock.sleep(BOOT_S)
