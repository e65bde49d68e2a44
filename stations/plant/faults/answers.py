"""Faults of a device's answers: exceptions, no answer, wrong words, writes that are ignored or incomplete."""

import numpy as np

from stations.plant.faults.base import AXES, DEVICES, MUTE, UNIT, Fault, Kind, WriteWords, add

ANY = (UNIT, *DEVICES)
NO_ANSWER = 11  # gateway target device failed to respond (Modbus Application Protocol 1.1b3, 7)


def _write_first_half(words: list[int], held: list[int] | None, write: WriteWords) -> int:
    """The trigger of a move is the last register, so nothing moves."""
    if len(words) == 1:
        write(words)
        return 0
    if held is not None:
        half = len(words) // 2
        write(words[:half] + held[half:])
    return 4  # server device failure


def _random_words(fault: Fault, now_us: int, address: int, words: list[int]) -> list[int]:
    """Seeded by time, address and device."""
    rng = np.random.default_rng([now_us, address, fault.device_id])
    return rng.integers(0, 65536, len(words)).tolist()


def _swapped_pairs(fault: Fault, now_us: int, address: int, words: list[int]) -> list[int]:
    even = len(words) // 2 * 2
    return [word for i in range(0, even, 2) for word in (words[i + 1], words[i])] + words[even:]


add(
    Kind(
        "exception_code",
        "A device answers every request with one exception: 4 for failure, 6 for busy, 2 for an unknown register.",
        ANY,
        {"code": 4.0},
    ),
    Kind(
        "exceptions_off",
        "A device ignores every write and acknowledges it: its exception responses are switched off (AZ series).",
        ANY,
        on_write=lambda *_: 0,
    ),
    Kind(
        "garbage",
        "A device reports random words in valid frames: its memory is corrupt and its interface works.",
        ANY,
        on_read=_random_words,
    ),
    Kind("mute", "A device sends no answer; every request times out.", ANY, exception=MUTE),
    Kind(
        "partial_write",
        "A device writes the first registers of a request and fails at the rest, which keep their old values.",
        (*AXES, "chamber", "reader"),
        on_write=_write_first_half,
    ),
    Kind(
        "silent",
        "The gateway reports that a device does not respond: unplugged, or without supply.",
        ANY,
        exception=NO_ANSWER,
    ),
    Kind(
        "swapped_words",
        "A device reports 32-bit numbers with their words exchanged: its word order was changed.",
        ANY,
        on_read=_swapped_pairs,
    ),
)
