"""Memory of a device under test for its coefficients: two copies in flash, and the offset registers of an ADXL355."""

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from schemas.errors import LinkLost, StationRefused, StationTimeout
from stations.clock import Clock
from stations.codec import Value
from stations.devices.registers import Registers

Copy = Literal["a", "b"]
COPIES: tuple[Copy, Copy] = ("a", "b")

PARTS, PART_WORDS = 3, 64
BYTES = 2 * PARTS * PART_WORDS
ERASED = b"\xff"
LONGEST_S, POLL_S = 10.0, 0.1


@dataclass(frozen=True)
class MemoryStatus:
    """State of the memory: ``ready``, ``busy`` or ``failed``; erasures by copy, and how many are specified."""

    state: str
    erases: dict[Copy, int]
    endurance: int


class UnitMemory:
    """The memory of the device in one slot. Every write is sent once; its success is decided by reading back."""

    def __init__(self, registers: Registers, clock: Clock) -> None:
        self._registers = registers
        self._clock = clock
        self.name = registers.name

    def require(self) -> None:
        """Refuses a device whose profile has no memory."""
        if not self._registers.has("memory_command"):
            raise StationRefused(
                f"{self.name}: profile {self._registers.profile.name} has no register 'memory_command', one is needed to write "
                "coefficients into the device; add the memory to the profile, or export the coefficients to a file"
            )

    def status(self) -> MemoryStatus:
        """The state now."""
        values = self._registers.read_group("memory")
        numbers = self._registers.profile.register("memory_state").enumeration
        names = {number: name for name, number in numbers.items()}
        state = names.get(self._count(values, "memory_state"), "unknown")
        erases: dict[Copy, int] = {copy: self._count(values, f"erases_{copy}") for copy in COPIES}
        return MemoryStatus(state, erases, self._count(values, "endurance"))

    def _count(self, values: Mapping[str, Value], register: str) -> int:
        value = values[register]
        if isinstance(value, int | float) and math.isfinite(value):
            return int(value)
        raise StationRefused(
            f"{self.name}: register {register} has {value!r}, a number is needed; check the slot's profile"
        )

    def read(self, copy: Copy) -> bytes:
        """The bytes of a copy."""
        words = [int(word) for k in range(PARTS) for word in self._registers.numbers(f"copy_{copy}_{k}")]
        return struct.pack(f">{len(words)}H", *words)

    def program(self, copy: Copy, content: bytes) -> None:
        """Programs a copy, once, and waits until it is done; the caller reads it back.

        Raises StationRefused: worn out, or the device states a failure
        Raises StationTimeout, LinkLost: the command was not carried out; it is not sent again
        """
        before = self.wait()
        if before.erases[copy] >= before.endurance:
            raise StationRefused(
                f"{self.name}: copy {copy.upper()} has {before.erases[copy]} erasures, {before.endurance} are specified; the "
                "memory is worn out: replace the device"
            )
        data = content.ljust(BYTES, ERASED)
        words = struct.unpack(f">{BYTES // 2}H", data)
        for k in range(PARTS):
            self._registers.set(f"buffer_{k}", [float(word) for word in words[k * PART_WORDS : (k + 1) * PART_WORDS]])
        lost: StationTimeout | LinkLost | None = None
        try:
            self._registers.write("memory_command", f"program_{copy}")
        except (StationTimeout, LinkLost) as problem:
            lost = problem
        after = self.wait()
        if after.erases[copy] == before.erases[copy]:
            raise lost or StationRefused(
                f"{self.name}: copy {copy.upper()} was not erased by the command to program it; check the device"
            )
        if after.state != "ready" or after.erases[copy] != before.erases[copy] + 1:
            raise StationRefused(
                f"{self.name}: memory is {after.state} after copy {copy.upper()} was programmed, with {after.erases[copy]} "
                f"erasures ({before.erases[copy] + 1} expected); replace the device"
            )

    def wait(self) -> MemoryStatus:
        """The state when the memory is no longer busy."""
        end = self._clock.now() + LONGEST_S
        while (status := self.status()).state == "busy":
            if self._clock.now() >= end:
                raise StationRefused(f"{self.name}: memory is busy for {LONGEST_S:g} s; check the device")
            self._clock.sleep(POLL_S)
        return status

    @property
    def offset_step(self) -> int:
        """Counts of the output per step of the offset registers; 0 for a device without them."""
        return int(self._registers.number("offset_step")) if self._registers.has("offset_step") else 0

    def offsets(self) -> tuple[int, int, int]:
        """Steps in the offset registers."""
        x, y, z = (int(value) for value in self._registers.numbers("offset"))
        return x, y, z

    def set_offsets(self, steps: Sequence[int]) -> None:
        """Writes the offset registers, once, and reads them back."""
        self._registers.set("offset", [float(step) for step in steps])
