"""The 1-Wire EEPROM of a simulated device, as a DS2431: 128 bytes, written in rows of eight by a scratchpad with its CRC-16."""

from dataclasses import dataclass, field

BYTES, ROW = 128, 8
WRITE_SCRATCHPAD, COPY_SCRATCHPAD = 0x0F, 0x55
ERASED = 0x00  # as the DS2431 is shipped
WHOLE, ACCEPTED = 0x07, 0x80  # of the byte E/S: end of the row; the row was copied


@dataclass
class Eeprom:
    """The memory of one device; it keeps its content without power.

    address, row : target and data that were sent; scratchpad : what a write put into the scratchpad, None where there is none
    protected : pages that cannot be written
    """

    memory: bytearray = field(default_factory=lambda: bytearray([ERASED] * BYTES))
    address: int = 0
    row: bytes = bytes(ROW)
    scratchpad: tuple[int, bytes] | None = None
    status: int = 0
    protected: set[int] = field(default_factory=set[int])

    def command(self, code: int) -> bool:
        """Carry out a command; False where the address is no row of the memory, or the code no command."""
        if code == WRITE_SCRATCHPAD and self.address % ROW == 0 and 0 <= self.address <= BYTES - ROW:
            self.scratchpad, self.status = (self.address, self.row), WHOLE
            return True
        if code == COPY_SCRATCHPAD and self.scratchpad is not None:
            address, row = self.scratchpad
            if address // (4 * ROW) not in self.protected:
                self.memory[address : address + ROW] = row
                self.status = ACCEPTED | WHOLE
            return True
        return False

    def power_off(self) -> None:
        """The scratchpad is lost."""
        self.scratchpad, self.status = None, 0

    @property
    def check(self) -> int:
        """Inverted CRC-16 over command, address and row of the scratchpad; 0 without a row."""
        if self.scratchpad is None:
            return 0
        address, row = self.scratchpad
        crc = 0
        for byte in (WRITE_SCRATCHPAD, address & 0xFF, address >> 8, *row):
            crc ^= byte
            for _ in range(8):
                crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
        return crc ^ 0xFFFF


def words_of(data: bytes) -> list[float]:
    """Bytes as words of a register, the first in the high byte."""
    return [float(data[k] << 8 | data[k + 1]) for k in range(0, len(data), 2)]


def bytes_of(words: list[float]) -> bytes:
    """The bytes of words."""
    return b"".join(int(word).to_bytes(2, "big") for word in words)
