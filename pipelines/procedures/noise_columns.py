"""White noise and flicker of the records of a procedure, as numbers of its points."""

from __future__ import annotations

import numpy as np
import pandas as pd

from inertial.dynamics.stability import ShortNoise

EARLIER_SHARE = 0.8  # relative standard deviation of F² from two Allan variances, in points of earlier versions


def noise_columns(noise: ShortNoise) -> dict[str, float]:
    """Numbers of a point: N² per s, F², and the standard deviation of the estimate of F²."""
    return {"white": noise.white, "flicker": noise.flicker, "flicker_error": noise.flicker_error}


def pooled_noise(rows: pd.DataFrame) -> ShortNoise:
    """Noise of one device from all its records in ``rows``: means, each record counting alike."""
    white, flicker = (np.maximum(rows[name].to_numpy(dtype=float), 0.0) for name in ("white", "flicker"))
    known = "flicker_error" in rows  # points of earlier versions have none
    error = rows["flicker_error"].to_numpy(dtype=float) if known else EARLIER_SHARE * flicker
    return ShortNoise(float(white.mean()), float(flicker.mean()), float(np.sqrt(np.sum(error**2)) / len(rows)))
