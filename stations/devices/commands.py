"""Text commands of a device by name: profile and link together."""

from schemas.errors import StationRefused
from schemas.profile import Command, Profile
from stations.codec import Value
from stations.devices.registers import Registers
from stations.links.gate import GatedLines

STEP = 0.1  # numbers are written with one decimal


class Commands:
    """Queries and commands of one device; ``name`` is its name in messages."""

    def __init__(self, name: str, link: GatedLines, profile: Profile) -> None:
        self.name = name
        self.profile = profile
        self._link = link

    def has(self, name: str) -> bool:
        """Whether the device has a command of that name."""
        return self.profile.has(name)

    def text(self, name: str) -> str:
        """The field of the answer that belongs to a command."""
        command = self.profile.command(name)
        answer = self._link.ask(command.ask, f"{self.name} {name}")
        fields = [field.strip() for field in answer.split(",")]
        if command.field >= len(fields):
            message = f"{self.name}: the answer to '{command.ask}' is '{answer}', {command.field + 1} fields are needed"
            raise StationRefused(f"{message}; check the device and its profile")
        return fields[command.field]

    def number(self, name: str) -> float:
        """A number from an answer."""
        text = self.text(name)
        try:
            return float(text)
        except ValueError:
            raise StationRefused(
                f"{self.name}: {name} is '{text}', a number is needed; check the device and its profile"
            ) from None

    def step(self, name: str) -> float:
        """The resolution of a written number."""
        return STEP if self.profile.command(name).type == "number" else 0.0

    def write(self, name: str, value: Value) -> None:
        """Sends a command, once."""
        command = self.profile.command(name)
        self._refuse_outside(command, value)
        self._link.tell(command.tell.format(value), f"{self.name} {name} = {value}")

    def _refuse_outside(self, command: Command, value: Value) -> None:
        low, high = command.minimum, command.maximum
        inside = isinstance(value, int | float) and (low is None or value >= low) and (high is None or value <= high)
        if not command.writable or not (value in command.values if command.type == "text" else inside):
            allowed = ", ".join(command.values) if command.type == "text" else f"{low} to {high} {command.unit}"
            message = f"{self.name}: {command.name} {value!r}; {allowed if command.writable else 'no write'} is allowed"
            raise StationRefused(f"{message}; give an allowed value")


Values = Registers | Commands
"""Values of one device by the names of its profile, for adapters that take both kinds of devices."""
