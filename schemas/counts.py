"""Numbers with their noun in messages, in the singular or the plural."""

from __future__ import annotations


def number_of(number: int, noun: str, plural: str = "") -> str:
    """``1 run``, ``2 runs``; ``plural`` where it is not the noun with an s."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"
