"""The package in its environment: diffusion against the series of its equation, stress that yields once, gas that leaks out."""

import numpy as np
import pytest

from stations.plant.hidden.package import DRY_MIDDLE, LeakyLid, MoistureDiffusion

REST = np.zeros((1, 3))
WARM = np.array([25.0])


def test_moisture_enters_as_the_series_of_the_diffusion_equation_says() -> None:
    plate = MoistureDiffusion(half_mm=0.2, diffusivity=2e-12)
    plate.surround(45.0, 1013.0)
    plate.slow(WARM, REST, 1.0)
    plate.surround(95.0, 1013.0)
    seconds = np.array([2000, 6000, 20000])
    found = []
    for k in range(1, seconds[-1] + 1):
        state = plate.slow(WARM, REST, 1.0)[0, 0]
        if k in seconds:
            found.append(state)
    # Crank, The Mathematics of Diffusion, 4.18: share of the final uptake of a plate of thickness 2l
    odd = 2.0 * np.arange(200) + 1.0
    decay = np.exp(-((odd * np.pi) ** 2) * 2e-12 * seconds[:, None] / (4.0 * 0.2e-3**2))
    share = 1.0 - np.sum(8.0 / (odd * np.pi) ** 2 * decay, axis=1)
    assert np.array(found) == pytest.approx(0.45 - DRY_MIDDLE + 0.5 * share, abs=0.006)


def test_water_moves_faster_in_the_heat() -> None:
    taken = []
    for celsius in (25.0, 55.0):
        plate = MoistureDiffusion()
        plate.surround(45.0, 1013.0)
        plate.slow(np.array([celsius]), REST, 1.0)
        plate.surround(95.0, 1013.0)
        taken.append([plate.slow(np.array([celsius]), REST, 1.0)[0, 0] for _ in range(1000)][-1])
    # uptake grows with the root of D·t at the beginning
    faster = np.exp(0.45 / 8.617e-5 * (1.0 / 298.15 - 1.0 / 328.15))
    assert taken[1] / taken[0] == pytest.approx(np.sqrt(faster), rel=0.1)


def test_gas_leaks_out_at_low_pressure_and_the_lid_bends_inwards_afterwards() -> None:
    lid = LeakyLid(leak_h=1.0, stiffening=0.0)
    lid.surround(45.0, 1000.0)
    assert lid.slow(WARM, REST, 1.0)[0, 0] == pytest.approx(0.0)
    lid.surround(45.0, 400.0)
    assert lid.slow(WARM, REST, 1.0)[0, 0] == pytest.approx(0.6, rel=1e-3)
    assert [lid.slow(WARM, REST, 1.0)[0, 0] for _ in range(3600)][-1] == pytest.approx(0.6 * np.exp(-1.0), rel=1e-2)
    lid.surround(45.0, 1000.0)
    assert lid.slow(WARM, REST, 1.0)[0, 0] == pytest.approx(-0.6 * (1.0 - np.exp(-1.0)), rel=1e-2)
