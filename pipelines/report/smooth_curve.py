"""A smooth curve through residuals with its band, as values and as marks of a chart."""

import numpy as np

from inertial.arrays import Array
from inertial.criticism.drivers import curve
from pipelines.drawing.chart import Role, Trace

_KNOTS = 5


def smooth(name: str, x: Array, y: Array, role: Role, period: float | None = None) -> list[Trace]:
    """The marks of :func:`band` and of its middle; none where there are too few points."""
    places, low, high = band(x, y, period)
    if not places.size:
        return []
    return [
        Trace(f"{name}: smooth curve, 95 %", places, low, "band", role, high=high, legend=False),
        Trace(f"{name}: smooth curve", places, 0.5 * (low + high), "line", role, legend=False),
    ]


def band(x: Array, y: Array, period: float | None = None) -> tuple[Array, Array, Array]:
    """Smooth curve through points with its 95 % band: (abscissas, low, high); empty where there are too few.

    Parameters
    ----------
    period : of a swing that the points follow, in the unit of x; then the curve is such a swing
    """
    there = np.isfinite(x) & np.isfinite(y)
    x, y = x[there], y[there]
    if x.size < 3 * _KNOTS or np.unique(np.round(x, 9)).size < 3:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    groups = _groups(x)
    places = np.linspace(x.min(), x.max(), 200 if period else 80) if period or groups > 3 else np.unique(x)
    abscissa = np.concatenate([x, places])
    both = _swing(abscissa, period) if period else _basis(abscissa, x.size, groups)
    design, at = both[: x.size], both[x.size :]
    coefficients, _, rank, _ = np.linalg.lstsq(design, y, rcond=1e-9)
    left = y - design @ coefficients
    variance = float(left @ left) / max(x.size - int(rank), 1)
    spread = 1.96 * np.sqrt(variance * np.einsum("ij,jk,ik->i", at, np.linalg.pinv(design.T @ design, rcond=1e-10), at))
    return places, at @ coefficients - spread, at @ coefficients + spread


def _swing(values: Array, period: float) -> Array:
    """Constant, sine and cosine."""
    phase = 2.0 * np.pi * values / period
    return np.stack([np.ones(values.size), np.sin(phase), np.cos(phase)], axis=-1)


def _groups(values: Array) -> int:
    """Number of groups that values fall into, separated by gaps of a twentieth of their range: usually soaks."""
    gaps = np.diff(np.sort(values))
    return 1 + int(np.count_nonzero(gaps > 0.05 * np.ptp(values)))


def _basis(values: Array, count: int, groups: int) -> Array:
    """Constant and smooth curve, knots from the first ``count`` values; a polynomial where values come in few groups.

    Between groups a spline is not determined.
    """
    if groups > 2 * _KNOTS or groups == 1:
        return np.concatenate([np.ones((values.size, 1)), curve(values, _KNOTS)], axis=-1)
    low, high = float(values[:count].min()), float(values[:count].max())
    z = 2.0 * (values - low) / max(high - low, 1e-12) - 1.0
    return np.stack([z**k for k in range(min(4, max(groups, 2)))], axis=-1)
