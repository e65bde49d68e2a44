"""Noise of the dwells of a device, by its preset or as it is given."""

from __future__ import annotations

from inertial.noise.dwells import DwellNoise
from inertial.noise.flicker import FLICKER_FLOOR
from schemas.recipe import Recipe
from stations.plant.preset import load_preset

UG = 1e-6  # of g


def noise_of(recipe: Recipe, device: str, density: float | None, wander: float | None) -> DwellNoise:
    """Noise of a preset, with given values in place of the preset's.

    Parameters
    ----------
    device : preset; the recipe's device where it is empty
    density : white noise, µg/√Hz · wander : flicker floor of the Allan deviation, µg
    """
    if density is not None and wander is not None:
        return DwellNoise(density * UG, wander * UG / FLICKER_FLOOR)
    preset = load_preset(device or recipe.device)
    white = preset.sampled_density_ug(recipe.rate_hz) if density is None else density
    if wander is not None:
        return DwellNoise(white * UG, wander * UG / FLICKER_FLOOR)
    return DwellNoise(white * UG, preset.bias_instability_ug * UG, preset.rate_random_walk_ug * UG)
