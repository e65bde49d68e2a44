"""The whole sphere on one ellipse, areas kept: +x in the middle, ±z at the poles.

Mollweide's projection (Snyder, Map Projections: A Working Manual, USGS 1395, 1987, eqs. 31-1 to 31-3).
"""

import numpy as np

from inertial.arrays import Array
from pipelines.drawing.chart import Anchor, Plot, PlotAxis, Trace

_STEPS = 30
LETTERS: dict[str, tuple[tuple[float, float, float], Anchor]] = {
    "+x": ((1.0, 0.0, 0.0), "top right"),
    "+y": ((0.0, 1.0, 0.0), "top right"),
    "−y": ((0.0, -1.0, 0.0), "top left"),
    "+z": ((0.0, 0.0, 1.0), "top center"),
    "−z": ((0.0, 0.0, -1.0), "bottom center"),
}
"""Direction of each letter, and the side on which it stands beside the lines that cross there, whatever the size."""


def project(direction: Array) -> tuple[Array, Array]:
    """Places of directions, (n, 3) → (n,) and (n,): x from −2 to 2, y from −1 to 1."""
    unit = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    longitude, sine = np.arctan2(unit[..., 1], unit[..., 0]), np.clip(unit[..., 2], -1.0, 1.0)
    angle = np.arcsin(sine)
    for _ in range(_STEPS):  # Newton; near a pole it halves its error every step only, where the slope vanishes too
        slope = 2.0 + 2.0 * np.cos(2.0 * angle)
        step = np.where(
            slope > 1e-12, (2.0 * angle + np.sin(2.0 * angle) - np.pi * sine) / np.maximum(slope, 1e-12), 0.0
        )
        angle = np.clip(angle - step, -0.5 * np.pi, 0.5 * np.pi)
    return 2.0 * longitude / np.pi * np.cos(angle), np.sin(angle)


def direction_at(x: float, y: float) -> Array | None:
    """The direction at a place of the map, (3,) in g; None outside of the sphere's outline."""
    if abs(y) > 1.0:
        return None
    angle = np.arcsin(y)
    longitude = np.pi * x / (2.0 * np.cos(angle)) if np.cos(angle) > 0.0 else 0.0
    if abs(longitude) > np.pi:
        return None
    latitude = np.arcsin(np.clip((2.0 * angle + np.sin(2.0 * angle)) / np.pi, -1.0, 1.0))
    return _direction(longitude, latitude)


def _direction(longitude: float, latitude: Array) -> Array:
    """Unit vectors (..., 3) at latitudes (...) of a meridian."""
    east, north = np.cos(longitude), np.sin(longitude)
    return np.stack([np.cos(latitude) * east, np.cos(latitude) * north, np.sin(latitude)], axis=-1)


def sphere(title: str, traces: tuple[Trace, ...]) -> Plot:
    """A plot of traces that were projected, on the outline with its meridians, the equator and the axes' letters."""
    return Plot(
        title,
        PlotAxis("", low=-2.12, high=2.12),  # room for the points at the edge
        PlotAxis("", low=-1.16, high=1.16),
        (*_graticule(), *traces),
        sphere=True,
    )


def _graticule() -> tuple[Trace, ...]:
    turn = np.linspace(0.0, 2.0 * np.pi, 121)
    latitude = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 41)
    lines = [Trace("", 2.0 * np.cos(turn), np.sin(turn), "line", "muted", legend=False)]
    meridians = (project(_direction(longitude, latitude)) for longitude in np.radians([-90.0, 0.0, 90.0]))
    lines += [Trace("", *places, "line", "muted", legend=False) for places in meridians]
    lines.append(Trace("", np.array([-2.0, 2.0]), np.zeros(2), "line", "muted", legend=False))
    x, y = project(np.array([direction for direction, _ in LETTERS.values()]))
    anchors: tuple[Anchor, ...] = tuple(anchor for _, anchor in LETTERS.values())
    lines.append(Trace("", x, y, "labels", "ink", texts=tuple(LETTERS), anchors=anchors, legend=False))
    return tuple(lines)
