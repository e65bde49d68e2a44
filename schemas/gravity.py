"""Gravity of a site by the Geodetic Reference System 1980: Somigliana's formula and the free-air reduction."""

from __future__ import annotations

import math

STANDARD_GRAVITY = 9.80665
"""m/s², CGPM 1901: a unit, and no site's value."""
FREE_AIR = -3.086e-6
"""m/s² per m of height."""
FORMULA_U_PPM = 60.0
"""Standard uncertainty of the formula: rms of eight published sites 56 ppm, ruled by one of them."""


def formula_gravity(latitude_deg: float, height_m: float = 0.0) -> float:
    """Normal gravity at a latitude with the free-air reduction, m/s² (Moritz 1980, GRS 1980)."""
    square = math.sin(math.radians(latitude_deg)) ** 2
    normal = 9.7803267715 * (1.0 + 0.001931851353 * square) / math.sqrt(1.0 - 0.0066943800229 * square)
    return normal + FREE_AIR * height_m
