"""The sprung mass in its gas: a film that damps it, by tables and kinetic theory, and a spring of silicon."""

import math
from dataclasses import dataclass

import numpy as np

from stations.plant.hidden.base import Array, HiddenEffect

KELVIN, REFERENCE_K, AMBIENT_HPA = 273.15, 298.15, 1013.25
AIR_K = np.array([200.0, 250.0, 300.0, 350.0, 400.0])
AIR_UPAS = np.array([13.25, 15.96, 18.46, 20.82, 23.01])  # viscosity of air, tables of gas properties
GAS_J_KG_K = 287.05
FIRST_SLIP = 6.0 * 1.1466  # of a film between two walls, to first order in λ/gap (Cercignani's coefficient)
MODULUS_GPA, SOFTENS_GPA_K, DEBYE_K = 167.5, 0.0158, 317.0  # Wachtman's law of silicon


@dataclass
class GasFilm(HiddenEffect):
    """A squeeze film of air: its viscosity, less what the molecules slip along the walls of a narrow gap.

    A vented package has the pressure of the room; the gas of a sealed one keeps its density.
    """

    share: float = 1.0  # of the damping ratio that is the film's
    gap_um: float = 3.0
    vented: float = 1.0

    def sprung(self, temperature: Array, pressure: float) -> tuple[Array, Array]:
        film = self._film(temperature + KELVIN, np.full_like(temperature, pressure))
        there = self._film(np.array([REFERENCE_K]), np.array([AMBIENT_HPA]))
        return np.ones_like(temperature), 1.0 + self.share * (film / there - 1.0)

    def _film(self, kelvin: Array, pressure: Array) -> Array:
        inside = pressure if self.vented else AMBIENT_HPA * kelvin / REFERENCE_K
        viscosity = np.interp(kelvin, AIR_K, AIR_UPAS)
        path_um = viscosity / (100.0 * inside) * np.sqrt(0.5 * math.pi * GAS_J_KG_K * kelvin)  # µPa·s/Pa·m/s = µm
        return np.asarray(viscosity / (1.0 + FIRST_SLIP * path_um / self.gap_um))


@dataclass
class SofteningSpring(HiddenEffect):
    """A spring of silicon, whose modulus falls with temperature by Wachtman's law; ``times`` for other materials."""

    times: float = 1.0

    def sprung(self, temperature: Array, pressure: float) -> tuple[Array, Array]:
        softer = (self._modulus(temperature + KELVIN) / self._modulus(np.array([REFERENCE_K])) - 1.0) * self.times
        natural = np.sqrt(1.0 + softer)
        return (
            natural,
            1.0 / natural,
        )  # the same film in front of a softer spring is a larger share of the critical damping

    @staticmethod
    def _modulus(kelvin: Array) -> Array:
        return MODULUS_GPA - SOFTENS_GPA_K * kelvin * np.exp(-DEBYE_K / kelvin)
