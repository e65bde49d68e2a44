"""The links of a station, made from its file: the only place that makes any, and behind each the gate for writes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from schemas.errors import RecipeInvalid
from schemas.profile import Carrier, Profile
from schemas.station import StationConfig
from schemas.station_devices import Carried, Devices
from stations.links.gate import GatedLines, GatedLink, Permit
from stations.links.lines import LineLink
from stations.links.modbus import WireLink
from stations.links.serial_wire import SerialWire
from stations.links.wires import TcpWire, Wire, tls_context
from stations.profile_files import load_profile

Address = tuple[str, int]
Key = tuple[str, str, int]


@dataclass
class Links:
    """Links by address, each made once; a simulated station's are ``simulated_at``, by what carries them.

    ``permit`` is what the gates ask before anything is sent; None where nothing is driven, or where no other process can drive.
    """

    config: StationConfig
    simulated_at: Mapping[Carrier, Address] = field(default_factory=dict["Carrier", "Address"])
    permit: Permit | None = None
    lines_at: Mapping[int, Address] = field(default_factory=dict[int, "Address"])
    made: dict[Key, GatedLink | GatedLines] = field(default_factory=dict["Key", "GatedLink | GatedLines"])

    def registers(self, place: str) -> GatedLink:
        """The link to the registers of the device at a place of the station, such as ``outer`` or ``slots``."""
        device, profile = self._at(place)
        if device.link == "ascii":
            raise RecipeInvalid(
                f"devices.{place}.link: ascii, registers need tcp, rtu or tls; correct the station's file",
                key=f"devices.{place}.link",
            )
        key = self._key(device)
        if key not in self.made:
            wire = self._wire(device, key)
            link = WireLink(wire, read_attempts=self.config.link.read_attempts)
            self.made[key] = GatedLink(link, wire.where, self._profiles(key), self.permit)
        made = self.made[key]
        if isinstance(made, GatedLines):
            raise self._shared(place, profile)
        return made

    def lines(self, place: str) -> GatedLines:
        """The line to the device at a place of the station."""
        device, profile = self._at(place)
        key = self._key(device)
        if key not in self.made:
            _, host, port = key
            patience = self.config.link
            line = LineLink(host, port, timeout_s=patience.timeout_s, read_attempts=patience.read_attempts)
            self.made[key] = GatedLines(line, f"{host}:{port}", profile, self.permit)
        made = self.made[key]
        if isinstance(made, GatedLink):
            raise self._shared(place, profile)
        return made

    def close(self) -> None:
        """Closes every link."""
        for link in self.made.values():
            link.close()

    def _at(self, place: str) -> tuple[Carried, Profile]:
        """The device at a place and its profile, which must be carried as the file says."""
        device = self._device(place)
        profile = load_profile(device.profile)
        if device.link not in profile.links:
            raise RecipeInvalid(
                f"devices.{place}.link: {device.link}, profile {profile.name} is carried by {' or '.join(profile.links)}; "
                "correct the station's file",
                key=f"devices.{place}.link",
            )
        return device, profile

    def _device(self, place: str) -> Carried:
        """The device at a place, or the equipment in a role."""
        equipment = self.config.fitted().get(place)
        return getattr(self.config.devices, place) if equipment is None else equipment

    def _key(self, device: Carried) -> Key:
        if self.config.kind == "simulated":
            own = self.lines_at.get(getattr(device, "device_id", 0))
            if device.link == "ascii" and own is not None:
                return (device.link, *own)
            if device.link not in self.simulated_at:
                carriers = " or ".join(self.simulated_at)
                raise RecipeInvalid(
                    f"link {device.link}: a simulated station's devices answer on {carriers}; correct the station's file",
                    key="link",
                )
            return (device.link, *self.simulated_at[device.link])
        return ("rtu", device.serial, 0) if device.link == "rtu" else (device.link, device.host, device.port)

    def _profiles(self, key: Key) -> dict[int, Profile]:
        """The profiles of all devices behind one address, by device id."""
        profiles: dict[int, Profile] = {}
        for place in Devices.model_fields:
            device = getattr(self.config.devices, place)
            if self._key(device) == key:
                ids = range(device.device_id, device.device_id + getattr(device, "count", 1))
                profiles.update(dict.fromkeys(ids, load_profile(device.profile)))
        for equipment in self.config.fitted().values():
            if equipment.link != "ascii" and self._key(equipment) == key:
                profiles[equipment.device_id] = load_profile(equipment.profile)
        return profiles

    def _wire(self, device: Carried, key: Key) -> Wire:
        _, host, port = key
        patience = self.config.link.timeout_s
        if device.link == "rtu":
            return SerialWire(
                device.serial, patience, baud=device.baud, parity=device.parity, stop_bits=device.stop_bits
            )
        if device.link == "tcp":
            return TcpWire(host, port, patience)
        files = [Path(name) if name else None for name in (device.ca_file, device.certificate_file, device.key_file)]
        try:
            context = tls_context(Path(device.ca_file), files[1], files[2])
        except OSError as problem:
            named = ", ".join(str(name) for name in files if name is not None)
            raise RecipeInvalid(
                f"station {self.config.name}: {named}: {problem}, readable PEM files are needed; correct the paths",
                key="ca_file",
            ) from None
        return TcpWire(host, port, patience, tls=context, server_name=device.server_name)

    def _shared(self, place: str, profile: Profile) -> RecipeInvalid:
        message = f"devices.{place}: profile {profile.name} at the address of a device that speaks otherwise; correct the file"
        return RecipeInvalid(message, key=f"devices.{place}")
