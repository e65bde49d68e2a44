"""The devices and the test equipment of a station's file."""

from functools import cache
from importlib.resources import files
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from schemas.bounds import Positive
from schemas.profile import Carrier, WordOrder
from schemas.strict import Grown, Strict
from schemas.toml_files import parse_toml

SIMULATED_EQUIPMENT = "simulated_equipment.toml"
MOST_SLOTS = 32  # the reader's registers name that many
LAST_DEVICE_ID = 247  # Modbus over serial line 1.02, 2.2
SERIAL = ("serial", "baud", "parity", "stop_bits")
SECURE = ("ca_file", "certificate_file", "key_file", "server_name")


class Carried(Strict):
    """A profile at an address; a simulated station leaves the address empty and gets its own.

    ``link`` is ``tcp``, ``tls``, ``ascii`` (lines over TCP), each to host and port, ``rtu`` on the line ``serial``, or ``visa``.
    With ``tls`` the device's certificate must be signed by the authority in ``ca_file`` and bear ``server_name``, or the host's
    name; ``certificate_file`` and ``key_file`` are shown to the device where it asks for them. ``word_order`` is that of a device
    which is set to another than its profile's.
    """

    profile: str
    word_order: WordOrder | None = None
    link: Carrier = "tcp"
    host: str = ""
    port: Annotated[int, Field(ge=0, le=65535)] = 502
    serial: str = ""
    baud: Annotated[int, Field(ge=300, le=1_000_000)] = 19200
    parity: Literal["none", "even", "odd"] = "even"
    stop_bits: Literal[1, 2] = 1
    ca_file: str = ""
    certificate_file: str = ""
    key_file: str = ""
    server_name: str = ""

    @model_validator(mode="after")
    def _of_one_kind(self) -> "Carried":
        for kind, names in (("rtu", SERIAL), ("tls", SECURE)):
            given = {} if self.link == kind else self.model_dump(include=set(names), exclude_defaults=True)
            stray = [name for name in names if name in given]
            if stray:
                raise ValueError(
                    f"{', '.join(stray)}: for link {kind}, the link is {self.link}; leave it out, or set link"
                )
        if bool(self.key_file) != bool(self.certificate_file):
            raise ValueError("certificate_file, key_file: one without the other; name both, or none")
        return self

    def missing(self) -> str:
        """The key that a real device at this address still needs; empty when it has all."""
        if self.link == "rtu":
            return "" if self.serial else "serial"
        if not self.host:
            return "host"
        return "ca_file" if self.link == "tls" and not self.ca_file else ""


class Device(Carried, Grown):
    """A device at an address.

    ``maximum`` bounds what may be ordered, by the names of the profile's orders, below the profile's own largest values; for an
    exciter also ``displacement_mm``, ``velocity_m_s`` and ``acceleration_g``, all peak values. The absolute maximum of the
    devices' supply is ``maximum.voltage`` of the power supply. ``resource`` is the VISA name of an instrument with link ``visa``,
    such as ``USB0::0x0957::0x17A6::MY1::INSTR`` or ``GPIB0::9::INSTR``.
    """

    later: ClassVar[frozenset[str]] = frozenset({"maximum", "resource"})

    device_id: Annotated[int, Field(ge=1, le=247)]
    maximum: dict[str, Positive] = Field(default_factory=dict[str, float])
    resource: str = ""

    @model_validator(mode="after")
    def _visa_alone_has_a_resource(self) -> "Device":
        if self.resource and self.link != "visa":
            raise ValueError(f"resource: for link visa, the link is {self.link}; leave it out, or set link")
        return self

    def missing(self) -> str:
        """The key that a real device at this address still needs; empty when it has all."""
        if self.link == "visa":
            return "" if self.resource else "resource"
        return super().missing()


class Slots(Carried):
    """The fixture's slots, ``count`` of them: slot n answers at ``device_id`` + n."""

    device_id: Annotated[int, Field(ge=1, le=240)]
    count: Annotated[int, Field(ge=1, le=MOST_SLOTS)] = 8

    @model_validator(mode="after")
    def _addressable(self) -> "Slots":
        last = self.device_id + self.count - 1
        if last > LAST_DEVICE_ID:
            raise ValueError(
                f"count: {self.count} slots from device_id {self.device_id} end at {last}, {LAST_DEVICE_ID} is the last id "
                "that Modbus has; begin lower"
            )
        return self


class Devices(Strict):
    """Everything that answers on the station's links."""

    outer: Device
    inner: Device
    chamber: Device
    reader: Device
    slots: Slots


class Equipment(Grown):
    """Equipment for test procedures besides table, chamber and reader, by the role that it has; none where it is left out.

    A simulated station has the built-in equipment besides, unless ``built_in`` is false.
    """

    later: ClassVar[frozenset[str]] = frozenset({"climate"})

    built_in: bool = True
    exciter: Device | None = None
    shock_machine: Device | None = None
    centrifuge: Device | None = None
    power_supply: Device | None = None
    step_generator: Device | None = None
    climate: Device | None = None

    def there(self) -> dict[str, Device]:
        """The equipment that the station has, by role."""
        devices = {role: getattr(self, role) for role in type(self).model_fields if role != "built_in"}
        return {role: device for role, device in devices.items() if device is not None}


@cache
def built_in_equipment() -> Equipment:
    """The test equipment of a simulated station whose file has none of its own."""
    source = f"stations/{SIMULATED_EQUIPMENT}"
    content = parse_toml(files("stations").joinpath(SIMULATED_EQUIPMENT).read_text("utf-8"), source)
    return Equipment.model_validate(content["equipment"])
