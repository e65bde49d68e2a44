"""Data faults, which must be corrected before effects are diagnosed. The first test that finds one decides for a unit."""

from inertial.data_errors.faults.exchanges import changed_units, swapped_units, wrong_poses
from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.faults.outputs import noisy, outliers, quantised, stuck
from inertial.data_errors.faults.records import clock, dropped, missing_dwells, truncated
from inertial.data_errors.faults.responses import dead, flipped, scale_units
from inertial.data_errors.faults.temperatures import stale, temperature_units
from inertial.data_errors.readings import Readings

LOOKS: tuple[Look, ...] = (
    truncated,
    clock,
    temperature_units,
    stuck,
    changed_units,
    dead,
    scale_units,
    flipped,
    swapped_units,
    wrong_poses,
    noisy,
    outliers,
    stale,
    quantised,
    dropped,
)

STILL_LOOKS: tuple[Look, ...] = (truncated, clock, temperature_units, stale, noisy, quantised, dropped)
"""Tests for a record in one pose: its response is unknown, and its output may repeat."""


def find_faults(readings: Readings) -> list[Fault]:
    """Data faults of a lot, at most one kind per unit; a unit without one can be diagnosed."""
    faults: dict[int, Fault] = {}
    for look in LOOKS if readings.turned else STILL_LOOKS:
        for fault in look(readings):
            faults.setdefault(fault.unit, fault)
    return [faults[u] for u in sorted(faults)]


__all__ = ["Fault", "find_faults", "missing_dwells"]
