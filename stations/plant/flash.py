"""Memory of a simulated device: two copies in flash, each with limited erasures, a buffer, and volatile offset registers."""

from dataclasses import dataclass, field

WORDS = 192
ERASED = 0xFFFF
ENDURANCE = 10_000
ERASE_S, PROGRAM_S = 0.3, 0.3
BUSY, READY, FAILED = 1, 0, 2
HALF = 0xF0F0  # of a word whose programming was interrupted, these bits have not been cleared yet


@dataclass
class Flash:
    """The memory of one device; times in µs of the plant."""

    copies: list[list[int]] = field(default_factory=lambda: [[ERASED] * WORDS, [ERASED] * WORDS])
    erases: list[int] = field(default_factory=lambda: [0, 0])
    endurance: int = ENDURANCE
    buffer: list[int] = field(default_factory=lambda: [0] * WORDS)
    offsets: list[int] = field(default_factory=lambda: [0, 0, 0])
    failed: bool = False
    stuck: dict[tuple[int, int], int] = field(default_factory=dict[tuple[int, int], int])  # bits that are always 0
    lose_power_s: float | None = None  # time after the next command at which the supply fails
    _begun_us: int = -1
    _copy: int = 0
    _data: list[int] = field(default_factory=list[int])

    def program(self, copy: int, now_us: int) -> None:
        """Begins to erase a copy and to program the buffer into it."""
        self.settle(now_us)
        self.erases[copy] += 1
        self._begun_us, self._copy, self._data = now_us, copy, list(self.buffer)

    def state(self, now_us: int) -> int:
        """Ready, busy or failed."""
        self.settle(now_us)
        return BUSY if self._begun_us >= 0 else FAILED if self.failed else READY

    def read(self, copy: int, now_us: int) -> list[int]:
        """The present words of a copy."""
        self.settle(now_us)
        words = self._partly(now_us) if self._begun_us >= 0 and copy == self._copy else self.copies[copy]
        return [word & ~self.stuck.get((copy, index), 0) & 0xFFFF for index, word in enumerate(words)]

    def power_off(self, now_us: int) -> None:
        """The supply fails: programming stops where it is; buffer and offsets are lost."""
        self.settle(now_us)
        if self._begun_us >= 0:
            self.copies[self._copy] = self._partly(now_us)
            self._begun_us = -1
        self.buffer, self.offsets = [0] * WORDS, [0, 0, 0]

    def settle(self, now_us: int) -> None:
        """Completes an operation whose time has passed."""
        if self._begun_us >= 0 and now_us >= self._begun_us + round(1e6 * (ERASE_S + PROGRAM_S)):
            self.failed = self.erases[self._copy] > self.endurance
            self.copies[self._copy] = [0] * WORDS if self.failed else self._data
            self._begun_us = -1

    def _partly(self, now_us: int) -> list[int]:
        """The words of the copy during an operation: erased, then programmed one after another."""
        share = (1e-6 * (now_us - self._begun_us) - ERASE_S) / PROGRAM_S
        if share < 0.0:  # an erasure that was interrupted leaves a mixture
            return [word | 0x0F0F for word in self.copies[self._copy]]
        done = int(share * WORDS)
        torn = [self._data[done] | HALF] if done < WORDS else []
        return (self._data[:done] + torn + [ERASED] * WORDS)[:WORDS]
