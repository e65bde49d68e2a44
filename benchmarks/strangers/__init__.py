"""Measured lots from a generator that knows nothing of the judge: its own station, devices, noises, faults and physics."""

from benchmarks.strangers.kinds import KINDS
from benchmarks.strangers.lots import Lot, make

__all__ = ["KINDS", "Lot", "make"]
