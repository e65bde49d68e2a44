"""The 1-Wire memory: its checksum is that of the published check value, and a page that is not written is told."""

import pytest

from schemas.errors import StationRefused
from stations.codec import Value
from stations.devices.teds_memory import TedsMemory, inverted_crc16
from stations.plant.eeprom import Eeprom, bytes_of, words_of

PAGE = bytes(range(32))


class Line:
    """Registers that carry out every write at once; ``torn`` changes a row on its way."""

    name = "slot 0"

    def __init__(self, memory: Eeprom, *, torn: bool = False) -> None:
        self.memory, self.torn = memory, torn

    def has(self, _name: str) -> bool:
        return True

    def set(self, name: str, value: Value) -> None:
        if name == "teds_address":
            self.memory.address = int(value)  # pyright: ignore[reportArgumentType] - an address is a number
        elif isinstance(value, list):
            self.memory.row = bytes(8) if self.torn else bytes_of(value)

    def write(self, _name: str, value: str) -> None:
        assert self.memory.command({"write_scratchpad": 15, "copy_scratchpad": 85}[value])

    def number(self, name: str) -> float:
        return float({"teds_check": self.memory.check, "teds_status": self.memory.status}[name])

    def numbers(self, _name: str) -> list[float]:
        return words_of(bytes(self.memory.memory))


def test_the_checksum_is_that_of_the_memories_of_the_maker() -> None:
    assert inverted_crc16(b"123456789") == 0x44C2  # CRC-16/MAXIM-DOW, its published check value


def test_a_page_is_written_where_it_belongs_and_read_back() -> None:
    memory = TedsMemory(Line(Eeprom()))  # pyright: ignore[reportArgumentType] - what it needs of registers
    memory.write_page(2, PAGE)
    assert memory.read() == bytes(64) + PAGE + bytes(32)


def test_a_row_that_is_changed_on_its_way_and_a_page_that_is_protected_are_told() -> None:
    torn = TedsMemory(Line(Eeprom(), torn=True))  # pyright: ignore[reportArgumentType]
    with pytest.raises(StationRefused, match=r"scratchpad at byte 32 has checksum .* check the signal line"):
        torn.write_page(1, PAGE)
    protected = Eeprom(protected={0})
    with pytest.raises(StationRefused, match=r"row at byte 0 was not copied \(status 0x07, 0x87 is needed\)"):
        TedsMemory(Line(protected)).write_page(0, PAGE)  # pyright: ignore[reportArgumentType]
    assert not any(protected.memory)


def test_a_memory_without_power_keeps_its_content_and_loses_its_scratchpad() -> None:
    memory = Eeprom(row=PAGE[:8])
    assert memory.command(15)
    assert memory.command(85)
    memory.power_off()
    assert bytes(memory.memory[:8]) == PAGE[:8]
    assert not memory.command(85)
    memory.address = 3
    assert not memory.command(15)
