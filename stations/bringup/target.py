"""The device of a bring-up: where it is, its values once it is found, and how it is left as it was found.

An axis is stopped, a chamber gets the set point and the mode that it had. Both the bring-up and its keeper, which outlives a
killed bring-up, send the same absolute orders; a device may get them twice.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from schemas.errors import RecipeInvalid, WrongUse
from schemas.profile import TEXT_CARRIERS, Profile, Register, WordOrder, limits_of
from schemas.station import Limits
from schemas.station_devices import Device
from stations.codec import Value
from stations.devices.adapters import adapter_of
from stations.devices.chamber import ThermalChamber
from stations.devices.commands import Commands, Values
from stations.devices.registers import Registers
from stations.devices.table import TableAxis
from stations.links.making import SingleLink
from stations.profile_files import in_order
from stations.recordings.decoding import told

NAME = "device"
FORMS = "tcp://HOST[:PORT], serial:DEVICE[,BAUD[,PARITY[,STOP]]] or visa:RESOURCE"
PORT = 502


def device_at(link: str, profile: Profile, device_id: int) -> Device:
    """The device that a link names.

    Raises WrongUse: it is not of one of the forms, or the profile is carried otherwise.
    """
    kind, _, rest = link.partition(":")
    content: dict[str, object] = {"profile": profile.name, "device_id": device_id}
    text = set(profile.links) <= TEXT_CARRIERS
    if kind == "tcp" and (match := re.fullmatch(r"//(\[[^\]]+\]|[^:/]+)(?::(\d{1,5}))?/?", rest)):
        content |= {"link": "ascii" if text else "tcp", "host": match[1].strip("[]"), "port": int(match[2] or PORT)}
    elif kind == "serial" and rest:
        path, *more = rest.split(",")
        content |= {"link": "rtu", "serial": path}
        content |= dict(
            zip(("baud", "parity", "stop_bits"), [int(v) if v.isdigit() else v for v in more], strict=False)
        )
    elif kind == "visa" and rest:
        content |= {"link": "visa", "resource": rest.removeprefix("//")}
    else:
        raise WrongUse(f"bring-up: link '{link[:80]}', one of {FORMS} is needed; correct it")
    if content["link"] not in profile.links:
        raise WrongUse(
            f"bring-up: link {content['link']}, profile {profile.name} is carried by {' or '.join(profile.links)}; correct it"
        )
    try:
        return Device.model_validate(content)
    except ValueError as problem:
        reason = str(problem).splitlines()[2].strip() if len(str(problem).splitlines()) > 2 else str(problem)
        raise WrongUse(f"bring-up: link '{link[:80]}': {reason}; {FORMS} is needed") from None


@dataclass
class Target:
    """The device of a bring-up: how it is reached, and the profile as it answers."""

    link: SingleLink
    profile: Profile

    @property
    def text(self) -> bool:
        """Whether the device speaks in lines of text."""
        return self.link.device.link in TEXT_CARRIERS

    def values(self) -> Values:
        """Access to the device's values by name, on a new connection."""
        self.link.profile = self.profile
        if self.text:
            return Commands(NAME, self.link.lines(), self.profile)
        return Registers(NAME, self.link.registers(), self.link.device.device_id, self.profile)

    def registers(self) -> Registers:
        """Access to the device's registers, on a new connection."""
        values = self.values()
        if not isinstance(values, Registers):
            raise RecipeInvalid(f"profile {self.profile.name}: registers are needed, it has commands", key="links")
        return values

    def ordered(self, order: WordOrder) -> None:
        """Takes another word order for every register."""
        self.profile = in_order(self.profile, order)

    def moved(self, shift: int, space: str) -> None:
        """Takes addresses that are ``shift`` further, in another space where it is given."""
        self.profile = self.profile.model_copy(update={"registers": moved(self.profile.registers, shift, space)})


def moved(registers: Iterable[Register], shift: int, space: str) -> list[Register]:
    """Registers at addresses that are ``shift`` further, in another space where it is given."""
    other = {"space": space} if space else {}
    return [register.model_copy(update={"address": register.address + shift, **other}) for register in registers]


SPEED_DEG_S = 1.0
ACCELERATION_DEG_S2 = 10.0
KEPT = {
    "axis": ("servo_on", "serial_mode"),
    "chamber": ("set_point", "set_point_basic", "set_point_manual", "mode", "remote_enable"),
}
"""Values that a bring-up may change and that start nothing when they are written back, in this order."""


@dataclass
class AsFound:
    """State of the device before the first order; ``moved`` says whether an axis has been ordered to move."""

    values: dict[str, Value] = field(default_factory=dict[str, Value])
    moved: bool = False


def limits_of_orders(profile: Profile, speed: float = SPEED_DEG_S) -> Limits:
    """Limits of the axis for the small orders of a bring-up."""
    low, high = bounds_of(profile, "target", (-360.0, 360.0))
    slowest, fastest = bounds_of(profile, "speed", (0.0, speed))
    slow = max(min(speed, fastest), slowest, smallest_speed(profile))
    least, most = bounds_of(profile, "acceleration", (0.0, ACCELERATION_DEG_S2))
    acceleration = max(min(ACCELERATION_DEG_S2, most), least)
    return Limits(outer_deg=(low, high), speed_deg_s=slow, acceleration_deg_s2=acceleration)


def smallest_speed(profile: Profile) -> float:
    """The smallest speed that can be ordered: a step of its register."""
    register = profile.register("speed") if profile.has("speed") else None
    return 0.0 if register is None or register.type == "float32" else register.scale


def bounds_of(profile: Profile, name: str, wide: tuple[float, float]) -> tuple[float, float]:
    """The limits of an order in the profile, inside ``wide``."""
    if not profile.has(name):
        return wide
    low, high = limits_of(profile.entry(name))
    return max(wide[0], low), min(wide[1], high)


def axis_of(target: Target, speed: float = SPEED_DEG_S) -> TableAxis:
    """The adapter of an axis, on a new connection, with the slow limits of a bring-up."""
    limits = limits_of_orders(target.profile, speed)
    return adapter_of(target.profile, "axis", TableAxis)(target.registers(), limits.outer_deg, limits)


def chamber_of(target: Target) -> ThermalChamber:
    """The adapter of a chamber, on a new connection."""
    bounds = bounds_of(target.profile, "set_point", (-100.0, 250.0))
    return adapter_of(target.profile, "chamber", ThermalChamber)(target.values(), *bounds)


def as_found(target: Target) -> AsFound:
    """The present values of all that an order may change."""
    found, values = AsFound(), target.values()
    for name in KEPT.get(target.profile.kind, ()):
        if target.profile.has(name) and target.profile.entry(name).writable:
            found.values[name] = value_of(values, name)
    return found


def leave_as_found(target: Target, found: AsFound) -> list[str]:
    """Stops an axis, writes back what has changed, and tells what was done.

    Raises StationError: the device did not take an order; it may be given again.
    """
    done: list[str] = []
    if target.profile.kind == "axis" and found.moved:
        axis_of(target).stop()
        done.append("axis stopped")
    values = target.values()
    for name, wanted in found.values.items():
        if value_of(values, name) != wanted:
            values.write(name, wanted)
            done.append(f"{name} back to {told(target.profile.entry(name), wanted)}")
    return done


def value_of(values: Values, name: str) -> Value:
    """A value as it can be written back."""
    if isinstance(values, Registers):
        return values.read(name)
    return values.number(name) if values.profile.command(name).type == "number" else values.text(name)
