"""What ``make test`` takes of a long suite, what ``make test-slow``, and what the figures of ``measured.md`` are made with."""

import os
from collections.abc import Iterable
from typing import Any

import pytest


def rounds(slow: int, measured: int) -> int:
    """How often a slow suite repeats."""
    return measured if os.environ.get("TUMBLELINE_LONG") == "1" else slow


def mostly_slow(values: Iterable[Any], *quick: Any) -> list[Any]:
    """The values of a parameter, or of several as tuples, of which ``make test`` has those named and the slow suite the rest."""
    listed = list(values)
    assert all(value in listed for value in quick), [value for value in quick if value not in listed]
    return [
        value
        if value in quick
        else pytest.param(*(value if isinstance(value, tuple) else (value,)), marks=pytest.mark.slow)
        for value in listed
    ]
