"""A device's lines of text by name: profile and link together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.errors import StationRefused

if TYPE_CHECKING:
    from schemas.profile import Command, Profile
    from stations.codec import Value
    from stations.links.link import TextLink

STEP = 0.1  # one decimal is what the lines are written with


class Commands:
    """Questions to and orders for one device; ``name`` is what messages call it."""

    def __init__(self, name: str, link: TextLink, profile: Profile) -> None:
        self.name = name
        self.profile = profile
        self._link = link

    def has(self, name: str) -> bool:
        """Whether the device has a command of that name."""
        return self.profile.has(name)

    def text(self, name: str) -> str:
        """The part of an answer that a command names."""
        command = self.profile.command(name)
        answer = self._link.ask(command.ask, f"{self.name} {name}")
        parts = [part.strip() for part in answer.split(",")]
        if command.field >= len(parts):
            message = f"{self.name}: '{command.ask}' was answered with '{answer}', {command.field + 1} parts are needed"
            raise StationRefused(f"{message}; check the device and its profile")
        return parts[command.field]

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
        """The last decimal of what is written."""
        return STEP if self.profile.command(name).type == "number" else 0.0

    def write(self, name: str, value: Value) -> None:
        """Gives an order, once."""
        command = self.profile.command(name)
        self._refuse_outside(command, value)
        self._link.tell(command.tell.format(value), f"{self.name} {name} = {value}")

    def _refuse_outside(self, command: Command, value: Value) -> None:
        low, high = command.minimum, command.maximum
        inside = isinstance(value, int | float) and (low is None or value >= low) and (high is None or value <= high)
        if not command.writable or not (value in command.values if command.type == "text" else inside):
            allowed = ", ".join(command.values) if command.type == "text" else f"{low} to {high} {command.unit}"
            message = (
                f"{self.name}: {command.name} {value!r}; {allowed if command.writable else 'reading only'} is allowed"
            )
            raise StationRefused(f"{message}; give a value inside")
