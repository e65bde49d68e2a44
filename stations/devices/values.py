"""Interface of adapters to the values of a device, for registers and for text commands."""

from typing import Protocol

from schemas.profile import Profile
from stations.codec import Value


class Values(Protocol):
    """Values of one device by the names of its profile; ``name`` is its name in messages."""

    name: str
    profile: Profile

    def has(self, name: str) -> bool:
        """Whether the device has a value of that name."""
        ...

    def number(self, name: str) -> float:
        """A number."""
        ...

    def text(self, name: str) -> str:
        """A text, or the name of an enumerated value."""
        ...

    def step(self, name: str) -> float:
        """The resolution of a value in transmission; zero for a float."""
        ...

    def write(self, name: str, value: Value) -> None:
        """Writes a value, once."""
        ...
