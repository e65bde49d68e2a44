"""The 1-Wire memory of a device for its TEDS: 128 bytes, written row by row through a scratchpad whose checksum is compared."""

import struct

from schemas.errors import StationRefused
from stations.devices.registers import Registers

BYTES, ROW, PAGE = 128, 8, 32
WRITE = 0x0F
ROW_COPIED = 0x87


def inverted_crc16(data: bytes) -> int:
    """CRC-16 of Maxim's memories (x¹⁶ + x¹⁵ + x² + 1, reflected, start 0), inverted as they send it."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return crc ^ 0xFFFF


class TedsMemory:
    """The memory of the device in one slot."""

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self.name = registers.name

    def require(self) -> None:
        """Refuses a device whose profile has no such memory."""
        if not self._registers.has("teds_command"):
            raise StationRefused(
                f"{self.name}: profile {self._registers.profile.name} has no register 'teds_command', one is needed to write "
                "TEDS into the device; add the memory to the profile, or export the pages to files with --format teds"
            )

    def read(self) -> bytes:
        """The whole memory."""
        words = [int(word) for word in self._registers.numbers("teds_memory")]
        return struct.pack(f">{len(words)}H", *words)

    def write_page(self, number: int, content: bytes) -> None:
        """Writes a page of 32 bytes, row by row; the caller reads the memory back.

        Raises StationRefused: the scratchpad differs from what was sent, or a row was not copied
        """
        if len(content) != PAGE or not 0 <= number < BYTES // PAGE:
            raise ValueError(f"page {number} of {len(content)} bytes")
        for start in range(0, PAGE, ROW):
            address, row = PAGE * number + start, content[start : start + ROW]
            self._registers.set("teds_address", address)
            self._registers.set("teds_scratchpad", [float(word) for word in struct.unpack(">4H", row)])
            self._registers.write("teds_command", "write_scratchpad")
            found = int(self._registers.number("teds_check"))
            needed = inverted_crc16(bytes([WRITE, address & 0xFF, address >> 8]) + row)
            if found != needed:
                raise StationRefused(
                    f"{self.name}: the scratchpad at byte {address} has checksum {found:#06x}, {needed:#06x} is needed; check "
                    "the signal line, and repeat the command"
                )
            self._registers.write("teds_command", "copy_scratchpad")
            status = int(self._registers.number("teds_status"))
            if status != ROW_COPIED:
                raise StationRefused(
                    f"{self.name}: the row at byte {address} was not copied (status {status:#04x}, {ROW_COPIED:#04x} is needed): "
                    "the page is write-protected; replace the memory"
                )
