"""Leaving a device as it was found: an axis stopped, a chamber with the set point and the mode that it had.

Both the bring-up and its keeper, which outlives a killed bring-up, send the same absolute orders; a device may get them twice.
"""

from dataclasses import dataclass, field

from schemas.profile import Profile
from schemas.station import Limits
from stations.bringup.target import Target
from stations.codec import Value
from stations.devices.adapters import axis_adapter, chamber_adapter
from stations.devices.axis import TableAxis
from stations.devices.chamber import ThermalChamber
from stations.devices.commands import Values
from stations.devices.registers import Registers
from stations.recordings.decoding import told

SPEED_DEG_S = 1.0
ACCELERATION_DEG_S2 = 10.0
KEPT = {
    "axis": ("servo_on", "serial_mode"),
    "chamber": ("set_point", "set_point_basic", "set_point_manual", "mode", "remote_enable"),
}
"""Values that a bring-up may change and that start nothing when they are written back, in this order."""


@dataclass
class AsFound:
    """What the device held before the first order; ``moved`` says whether an axis has been ordered to move."""

    values: dict[str, Value] = field(default_factory=dict[str, Value])
    moved: bool = False


def limits_of_orders(profile: Profile, speed: float = SPEED_DEG_S) -> Limits:
    """Limits of the axis for the small orders of a bring-up."""
    low, high = bounds_of(profile, "target", (-360.0, 360.0))
    slowest, fastest = bounds_of(profile, "speed", (0.0, speed))
    slow = max(min(speed, fastest), slowest, smallest_speed(profile))
    least, most = bounds_of(profile, "acceleration", (0.0, ACCELERATION_DEG_S2))
    kept = max(min(ACCELERATION_DEG_S2, most), least)
    return Limits(outer_deg=(low, high), speed_deg_s=slow, acceleration_deg_s2=kept)


def smallest_speed(profile: Profile) -> float:
    """The smallest speed that can be ordered: a step of its register."""
    if not profile.has("speed"):
        return 0.0
    register = profile.register("speed")
    return 0.0 if register.type == "float32" else register.scale


def bounds_of(profile: Profile, name: str, wide: tuple[float, float]) -> tuple[float, float]:
    """The limits of an order in the profile, inside ``wide``."""
    if not profile.has(name):
        return wide
    entry = profile.entry(name)
    low = wide[0] if entry.minimum is None else max(wide[0], entry.minimum)
    high = wide[1] if entry.maximum is None else min(wide[1], entry.maximum)
    return low, high


def axis_of(target: Target, speed: float = SPEED_DEG_S) -> TableAxis:
    """The adapter of an axis, on a new connection, with the slow limits of a bring-up."""
    limits = limits_of_orders(target.profile, speed)
    return axis_adapter(target.profile)(target.registers(), limits.outer_deg, limits)


def chamber_of(target: Target) -> ThermalChamber:
    """The adapter of a chamber, on a new connection."""
    bounds = bounds_of(target.profile, "set_point", (-100.0, 250.0))
    return chamber_adapter(target.profile)(target.values(), *bounds)


def as_found(target: Target) -> AsFound:
    """What the device holds now, of what an order may change."""
    found, values = AsFound(), target.values()
    for name in KEPT.get(target.profile.kind, ()):
        if target.profile.has(name) and target.profile.entry(name).writable:
            found.values[name] = _value(values, name)
    return found


def leave_as_found(target: Target, found: AsFound) -> list[str]:
    """Stops an axis, writes back what has changed, and tells what was done.

    Raises
    ------
    StationError
        The device did not take an order; it may be given again.
    """
    done: list[str] = []
    if target.profile.kind == "axis" and found.moved:
        axis = axis_of(target)
        axis.stop()
        done.append("axis stopped")
    values = target.values()
    for name, wanted in found.values.items():
        if _value(values, name) != wanted:
            values.write(name, wanted)
            done.append(f"{name} back to {told(target.profile.entry(name), wanted)}")
    return done


def _value(values: Values, name: str) -> Value:
    """A value as it can be written back."""
    if isinstance(values, Registers):
        return values.read(name)
    return values.number(name) if values.profile.command(name).type == "number" else values.text(name)
