"""The links of a station, made from its file: they are made here alone, and behind each is the gate for writes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from schemas.errors import RecipeInvalid
from schemas.profile import TEXT_CARRIERS, Carrier, Profile
from schemas.station import StationConfig
from schemas.station_devices import Carried, Device, Devices, Slots
from stations.links.gate import GatedLines, GatedLink, Permit
from stations.links.lines import LineLink, TcpLines, VisaLines
from stations.links.modbus import WireLink
from stations.links.recorder import FrameRecorder, RecordedLines, RecordedWire, active_recorder
from stations.links.serial_wire import SerialWire
from stations.links.wires import LineWire, TcpWire, Wire, tls_context
from stations.profile_files import load_profile

Address = tuple[str, int]
Key = tuple[str, str, int]
Behind = dict[int, tuple[str, Profile]]  # name and profile of every device behind one address, by device id


class WireSource(Protocol):
    """Wires instead of those to devices, such as those of a replayed recording."""

    def wire(self, link: str, where: str) -> Wire:
        """The Modbus wire of a link, which has the name of its first device; ``where`` is its address in messages."""
        ...

    def lines(self, link: str, where: str) -> LineWire:
        """The text connection of a link."""
        ...


@dataclass
class Links:
    """Links by address, each made once; a simulated station's are ``simulated_at``, by what carries them.

    ``permit`` is what the gates ask before anything is sent; None where nothing is driven, or where no other process can drive.
    ``recorder`` records every exchange; ``instead`` gives wires instead of those to devices.
    """

    config: StationConfig
    simulated_at: Mapping[Carrier, Address] = field(default_factory=dict["Carrier", "Address"])
    permit: Permit | None = None
    lines_at: Mapping[int, Address] = field(default_factory=dict[int, "Address"])
    made: dict[Key, GatedLink | GatedLines] = field(default_factory=dict["Key", "GatedLink | GatedLines"])
    recorder: FrameRecorder | None = field(default_factory=active_recorder)
    instead: WireSource | None = None

    def registers(self, name: str) -> GatedLink:
        """The link to the registers of the device of this name in the station file, such as ``outer`` or ``slots``."""
        device, profile = self._at(name)
        if device.link in TEXT_CARRIERS:
            raise RecipeInvalid(
                f"devices.{name}.link: {device.link}, registers need tcp, rtu or tls; correct the station's file",
                key=f"devices.{name}.link",
            )
        key, settings = self._key(device), self.config.link
        if key not in self.made:
            behind = self._behind(key)
            if self.instead is None:
                wire = wire_to(device, *key[1:], settings.timeout_s)
            else:
                wire = self.instead.wire(next(iter(behind.values()))[0], _where(key))
            self.made[key] = _gated_link(wire, behind, self.recorder, settings.read_attempts, self.permit)
        made = self.made[key]
        if isinstance(made, GatedLines):
            raise self._shared(name, profile)
        return made

    def lines(self, name: str) -> GatedLines:
        """The line to the device of this name in the station file."""
        device, profile = self._at(name)
        key, settings = self._key(device), self.config.link
        if key not in self.made:
            if self.instead is None:
                wire = lines_to(device, *key[1:], settings.timeout_s)
            else:
                wire = self.instead.lines(name, _where(key))
            self.made[key] = _gated_lines(wire, name, profile, self.recorder, settings.read_attempts, self.permit)
        made = self.made[key]
        if isinstance(made, GatedLink):
            raise self._shared(name, profile)
        return made

    def close(self) -> None:
        """Closes every link."""
        for link in self.made.values():
            link.close()

    def _at(self, name: str) -> tuple[Device | Slots, Profile]:
        """The device of a name, or the equipment in a role, and its profile, which must be carried as the file says."""
        equipment = self.config.fitted().get(name)
        device: Device | Slots = getattr(self.config.devices, name) if equipment is None else equipment
        profile = load_profile(device.profile)
        if device.link not in profile.links:
            raise RecipeInvalid(
                f"devices.{name}.link: {device.link}, profile {profile.name} is carried by {' or '.join(profile.links)}; "
                "correct the station's file",
                key=f"devices.{name}.link",
            )
        return device, profile

    def _key(self, device: Device | Slots) -> Key:
        if self.config.kind == "simulated" and self.instead is not None:
            return (device.link, "", device.device_id if device.link in TEXT_CARRIERS else 0)
        if self.config.kind == "simulated":
            address = self.lines_at.get(device.device_id)
            if device.link in TEXT_CARRIERS and address is not None:
                return (device.link, *address)
            if device.link not in self.simulated_at:
                carriers = " or ".join(self.simulated_at)
                raise RecipeInvalid(
                    f"link {device.link}: a simulated station's devices answer on {carriers}; correct the station's file",
                    key="link",
                )
            return (device.link, *self.simulated_at[device.link])
        if device.link == "visa":
            return (device.link, getattr(device, "resource", ""), 0)
        return ("rtu", device.serial, 0) if device.link == "rtu" else (device.link, device.host, device.port)

    def _behind(self, key: Key) -> Behind:
        """The devices behind an address; the first of them names the link."""
        behind: Behind = {}
        for name in Devices.model_fields:
            device = getattr(self.config.devices, name)
            if self._key(device) == key:
                names = [f"slot {n}" for n in range(getattr(device, "count", 0))] or [name]
                profile = load_profile(device.profile)
                behind |= {device.device_id + n: (label, profile) for n, label in enumerate(names)}
        for role, equipment in self.config.fitted().items():
            if equipment.link not in TEXT_CARRIERS and self._key(equipment) == key:
                behind[equipment.device_id] = role, load_profile(equipment.profile)
        return behind

    def _shared(self, name: str, profile: Profile) -> RecipeInvalid:
        message = (
            f"devices.{name}: profile {profile.name} at the address of a device that speaks otherwise; correct the file"
        )
        return RecipeInvalid(message, key=f"devices.{name}")


def _where(key: Key) -> str:
    """The address of a link, as messages name it."""
    _, host, port = key
    return f"{host}:{port}" if port else host


def _gated_link(
    wire: Wire, behind: Behind, recorder: FrameRecorder | None, attempts: int, permit: Permit | None
) -> GatedLink:
    """The gate before a wire with these devices behind it; in a recording it has the name of the first device."""
    if recorder is not None:
        name = next(iter(behind.values()))[0]
        for device_id, (device, profile) in behind.items():
            recorder.device(name, device_id, device, profile)
        wire = RecordedWire(wire, recorder, name)
    profiles = {device_id: profile for device_id, (_, profile) in behind.items()}
    return GatedLink(WireLink(wire, read_attempts=attempts), wire.where, profiles, permit)


def _gated_lines(
    wire: LineWire, name: str, profile: Profile, recorder: FrameRecorder | None, attempts: int, permit: Permit | None
) -> GatedLines:
    if recorder is not None:
        recorder.device(name, 0, name, profile)
        wire = RecordedLines(wire, recorder, name)
    return GatedLines(LineLink(wire, read_attempts=attempts), wire.where, profile, permit)


def wire_to(device: Carried, host: str, port: int, timeout_s: float) -> Wire:
    """The Modbus wire to a device; ``host`` and ``port`` are where it is, which a simulated station decides."""
    if device.link == "rtu":
        return SerialWire(device.serial, timeout_s, baud=device.baud, parity=device.parity, stop_bits=device.stop_bits)
    if device.link == "tcp":
        return TcpWire(host, port, timeout_s)
    files = [Path(name) if name else None for name in (device.ca_file, device.certificate_file, device.key_file)]
    try:
        context = tls_context(Path(device.ca_file), files[1], files[2])
    except OSError as problem:
        named = ", ".join(str(name) for name in files if name is not None)
        raise RecipeInvalid(
            f"link tls to {host}: {named}: {problem}, readable PEM files are needed; correct the paths", key="ca_file"
        ) from None
    return TcpWire(host, port, timeout_s, tls=context, server_name=device.server_name)


def lines_to(device: Carried, host: str, port: int, timeout_s: float) -> LineWire:
    """The connection for lines of text to a device."""
    if device.link == "visa":
        return VisaLines(getattr(device, "resource", ""), timeout_s)
    return TcpLines(host, port, timeout_s)


@dataclass
class SingleLink:
    """The link to one device without a station around it, behind the same gate: for its bring-up.

    ``device`` may be replaced while nothing is open, to look for it elsewhere. ``lease`` is asked before each write.
    """

    device: Device
    profile: Profile
    timeout_s: float
    permit: Permit | None = None
    recorder: FrameRecorder | None = field(default_factory=active_recorder)
    name: str = "device"
    _made: GatedLink | GatedLines | None = None

    def registers(self) -> GatedLink:
        """The link to its registers, on a new connection."""
        self.close()
        wire = wire_to(self.device, self.device.host, self.device.port, self.timeout_s)
        behind = {self.device.device_id: (self.name, self.profile)}
        self._made = made = _gated_link(wire, behind, self.recorder, 1, self.permit)
        return made

    def lines(self) -> GatedLines:
        """The connection for its lines, anew."""
        self.close()
        wire = lines_to(self.device, self.device.host, self.device.port, self.timeout_s)
        self._made = made = _gated_lines(wire, self.name, self.profile, self.recorder, 1, self.permit)
        return made

    def close(self) -> None:
        """Ends the connection."""
        if self._made is not None:
            self._made.close()
            self._made = None
