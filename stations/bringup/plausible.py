"""Whether the words of a register can be its value: by its type, names, unit and limits, for a word order that is to be found."""

import math
from collections.abc import Mapping, Sequence

from schemas.profile import Profile, Register, WordOrder
from stations.codec import Value, decode

ORDERS: tuple[WordOrder, ...] = ("high_first", "low_first", "high_first_swapped", "low_first_swapped")
USUAL: dict[str, tuple[float, float]] = {
    "degC": (-120.0, 320.0),
    "%": (-110.0, 400.0),
    "deg": (-40_000.0, 40_000.0),
    "deg/s": (-2_000.0, 2_000.0),
    "K/min": (-200.0, 200.0),
    "s": (0.0, 1e9),
    "V": (-1_000.0, 1_000.0),
    "Hz": (0.0, 1e6),
}
"""What values of a unit can be on equipment of a station at rest."""
FLOATS = (1e-12, 1e12)  # magnitudes of a float with an unknown unit; words in a wrong order give any exponent


Votes = dict[WordOrder, tuple[int, int]]


def plausible(register: Register, value: Value) -> bool | None:
    """Whether a value can be that of a register at rest; None where it says nothing, such as zero."""
    if isinstance(value, str):
        return None if not value.strip() else value.isprintable() and value.isascii()
    if isinstance(value, list):
        judged = [plausible(register.model_copy(update={"count": 1}), element) for element in value]
        return None if all(element is None for element in judged) else all(element is not False for element in judged)
    if not math.isfinite(value):
        return False
    if register.enumeration:
        return value in register.enumeration.values()
    return _bits(register, int(value)) if register.bits else _number(register, value)


def _number(register: Register, value: float) -> bool | None:
    """Whether a number is possible in its unit; zero says nothing."""
    if value == 0.0:
        return None
    if register.type == "float32" and not FLOATS[0] < abs(value) < FLOATS[1]:
        return False
    low, high = USUAL.get(register.unit, (-math.inf, math.inf))
    if register.minimum is not None or register.maximum is not None:  # wide: a wrong limit is no wrong word order
        sides = [abs(side) for side in (register.minimum, register.maximum) if side is not None]
        reach = 10.0 * max(*sides, 1.0) if register.unit not in USUAL else math.inf
        low, high = max(low, -reach), min(high, reach)
    inside = low <= value <= high
    return inside if math.isfinite(low) or math.isfinite(high) or register.type == "float32" else None


def _bits(register: Register, value: int) -> bool | None:
    """Named bits may be set beside others; a value with others alone is rather that of another word order."""
    if value == 0:
        return None
    named = sum(value >> bit & 1 for bit in register.bits.values())
    others = value.bit_count() - named
    return True if named > others else None if named else False


def votes(profile: Profile, words: Mapping[str, Sequence[int]], order: WordOrder, *, orderly: bool) -> tuple[int, int]:
    """Numbers of registers with a plausible and with an implausible value in a word order.

    words : by register, as they were read
    orderly : only registers of two words, which alone depend on the order; else all
    """
    good = bad = 0
    for name, raw in words.items():
        register = profile.register(name)
        if orderly and not depends_on_order(register):
            continue
        verdict = plausible(register, decode(register, order, raw))
        good += verdict is True
        bad += verdict is False
    return good, bad


def depends_on_order(register: Register) -> bool:
    """Whether the value of a register depends on the order of its words or bytes."""
    return register.type in {"uint32", "int32", "float32"}


def best_order(profile: Profile, words: Mapping[str, Sequence[int]]) -> tuple[WordOrder | None, Votes]:
    """The word order in which the values are plausible, and the votes for each.

    None where nothing tells: no register of two words holds anything but zero, or two orders do equally well and the profile's is
    not among them.
    """
    counted: Votes = {order: votes(profile, words, order, orderly=True) for order in ORDERS}
    score = {order: good - 3 * bad for order, (good, bad) in counted.items()}
    most = max(score.values())
    best: list[WordOrder] = [order for order in ORDERS if score[order] == most]
    if most <= 0 or len(set(score.values())) == 1:
        return None, counted
    if profile.word_order in best:
        return profile.word_order, counted
    return (best[0] if len(best) == 1 else None), counted
