"""Rounds of the slow suites of faults: those of ``make test-slow``, or with TUMBLELINE_LONG=1 those of ``measured.md``."""

import os


def rounds(slow: int, measured: int) -> int:
    """How often a slow suite repeats."""
    return measured if os.environ.get("TUMBLELINE_LONG") == "1" else slow
