"""Centrifuge runs made by mechanics: the rate is set for the nominal radius, the proof mass sits elsewhere, the arm stretches."""

import numpy as np

from inertial.dynamics.centrifuge_effects import Spins

G = 9.80665
RADIUS_ERROR = 20e-6
FLOOR_G = 1e-5
UP = np.array([1.0, 3.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0])


def spins(
    radii: tuple[float, ...] = (0.5, 0.3), signs: tuple[float, ...] = (1.0, -1.0), radius_error: float = RADIUS_ERROR
) -> Spins:
    """Points up to 30 g and back, in each mounting and at each radius."""
    way = np.concatenate([UP, UP[-2::-1]])
    a = np.array([s * f for _ in radii for s in signs for f in way])
    slow = np.tile(np.arange(way.size) >= UP.size, len(signs) * len(radii)).astype(float)
    return Spins(a, np.repeat(radii, len(signs) * way.size), np.linspace(0.0, 1.0, a.size), slow, radius_error)


def spun(
    points: Spins, true: dict[str, float], rng: np.random.Generator, floor_g: float = FLOOR_G, share: float = 2e-6
) -> tuple[np.ndarray, np.ndarray, dict[float, float]]:
    """Outputs in g, their uncertainties (a floor and a share of the force), and where the holes of the arm are."""
    of = ({"scale": 1.0004, "second_order": 2e-6, "third_order": 5e-8} | true).get
    sign, size = np.sign(points.acceleration), np.abs(points.acceleration)
    rate2 = size * G / points.radius_m
    holes = {r: r + points.radius_error_m * rng.normal() for r in np.unique(points.radius_m)[::-1]}
    radius = np.array([holes[r] for r in points.radius_m])
    radius = radius * (1.0 + of("arm_stretch", 0.0) * rate2) + sign * of("mass_offset", 0.0)
    a = sign * radius * rate2 / G * (1.0 + share * rng.normal(size=sign.size))
    out = 2e-3 + (of("scale") + of("scale_drift", 0.0) * points.order) * a + of("second_order") * a**2
    out = out + of("third_order") * a**3 + of("odd_quadratic", 0.0) * a * np.abs(a) + of("asymmetry", 0.0) * np.abs(a)
    return out + floor_g * rng.normal(size=sign.size), np.hypot(floor_g, share * size), holes
