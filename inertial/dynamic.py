"""Dynamic tests under their first names; the mathematics is in :mod:`inertial.dynamics`."""

from __future__ import annotations

from inertial.dynamics.centrifuge import Centrifuge, centrifuge
from inertial.dynamics.pulses import Shock, half_sine
from inertial.dynamics.second_order import SecondOrder, bandwidth, damping_from_peak, fit_second_order, transfer
from inertial.dynamics.settling import settling_time

__all__ = [
    "Centrifuge",
    "SecondOrder",
    "Shock",
    "bandwidth",
    "centrifuge",
    "damping_from_peak",
    "fit_second_order",
    "half_sine",
    "settling_time",
    "transfer",
]
