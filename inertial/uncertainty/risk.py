"""Risk of decisions: probability of false acceptance and false rejection for production (JCGM 106:2012).

The specific risk (7.3, 7.4), of one unit, is in :mod:`schemas.decisions`. Global risk (9): over units X ~ N(μ, σ_p) that are
measured as Y = X + N(0, u) and accepted where A_L ≤ Y ≤ A_U.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from inertial.arrays import Array

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_REACH = 9.0
"""Standard deviations beyond which a normal density is nothing."""


@dataclass(frozen=True)
class GlobalRisk:
    """Probabilities over a production.

    pfa : accepted although outside its limits; pfr : rejected although inside; accepted : in all
    """

    pfa: float
    pfr: float
    accepted: float


def lot_risk(
    mean: float,
    process: float,
    u: float,
    shared: float,
    limits: tuple[float, float],
    accepted: tuple[float, float],
) -> GlobalRisk:
    """Risks over a lot whose measurements have an error in common, that of the references: X = Z − C, Y = Z + E.

    Z ~ N(mean, process²) is a unit as the references show it, C ~ N(0, shared²) one error of the whole lot, E ~ N(0, u²) that
    of a measurement. The scatter of the lot says nothing of C, and no number of units averages it away. Given Z, X and Y are
    independent.

    Parameters
    ----------
    mean, process : of the units as measured, without E; zero process: all are alike
    u, shared : standard uncertainty of a measurement, and of the error in common
    limits, accepted : lower and upper tolerance limit, and acceptance limit
    """
    z, weight = _nodes(mean, process, [(limits, shared), (accepted, u)])
    good, taken = (_between(z, ends, width) for ends, width in ((limits, shared), (accepted, u)))
    return GlobalRisk(
        float(weight @ ((1.0 - good) * taken)),
        float(weight @ (good * (1.0 - taken))),
        float(weight @ taken),
    )


def _nodes(mean: float, process: float, turns: list[tuple[tuple[float, float], float]]) -> tuple[Array, Array]:
    """Places and weights of an integral over N(mean, process²), in panels that end where a factor turns."""
    if not process > 0.0:
        return np.array([mean]), np.ones(1)
    low, high = mean - _REACH * process, mean + _REACH * process
    steps = (-8.0, -4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0, 8.0)
    nodes = [end + k * width for ends, width in [*turns, ((mean, mean), process)] for end in ends for k in steps]
    edges = np.unique(np.clip([low, high, *nodes], low, high))
    half, middle = 0.5 * np.diff(edges)[:, None], 0.5 * (edges[1:] + edges[:-1])[:, None]
    z = middle + half * _NODES
    density = np.exp(-0.5 * ((z - mean) / process) ** 2) / (process * np.sqrt(2.0 * np.pi))
    return z.ravel(), (half * _WEIGHTS * density).ravel()


def _between(z: Array, ends: tuple[float, float], width: float) -> Array:
    """Probability that z with a normal error lies between two ends."""
    if not width > 0.0:
        return np.asarray((ends[0] <= z) & (z <= ends[1]), dtype=np.float64)
    return np.asarray(ndtr((ends[1] - z) / width) - ndtr((ends[0] - z) / width), dtype=np.float64)


def process_deviation(values: list[float], independent: float) -> float:
    """σ_p of a production by the scatter of its values: σ_p² = s² − u², of uncertainties that are not common to the lot."""
    if len(values) < 2:
        return float("nan")
    return float(np.sqrt(max(float(np.var(values, ddof=1)) - independent**2, 0.0)))
