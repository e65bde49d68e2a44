"""Recordings as people make them by hand: a sensor turned from one position to the next, from plain physics."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

G = 9.80665


@dataclass(frozen=True)
class Recording:
    """A record: rate Hz, time (n,) s, output (n, 3) in the unit of `per_g`, spans of the dwells, directions (k, 3) of gravity."""

    rate: float
    time: np.ndarray
    output: np.ndarray
    spans: list[tuple[int, int]]
    directions: np.ndarray
    per_g: float
    noise: float


FACES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)


def recording(rng: np.random.Generator, *, rate: float = 100.0, positions: int = 12, per_g: float = 16384.0,
              noise: float = 5.0, directions: np.ndarray | None = None, moves: bool = True) -> Recording:  # fmt: skip
    """A hand-held recording in counts, or in any unit with `noise` and `per_g` in it; without the moves where not wanted."""
    if directions is None:
        directions = rng.normal(size=(positions, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    bias, response = rng.normal(0.0, 0.02, 3), np.eye(3) + rng.normal(0.0, 0.01, (3, 3))
    parts, spans, at = [], [], 0
    for k, direction in enumerate(directions):
        count = int(rate * rng.uniform(2.5, 6.0))
        parts.append(np.repeat(direction[None], count, axis=0))
        spans.append((at, at + count))
        at += count
        if moves and k + 1 < len(directions):
            count = max(8, int(rate * rng.uniform(0.6, 1.5)))
            share = np.linspace(0.0, 1.0, count)[:, None]
            shake = 0.25 * rng.normal(size=(count, 3)).cumsum(axis=0) / np.sqrt(count)
            shake += 0.15 * np.sin(np.linspace(0.0, 12.0, count))[:, None] * rng.normal(size=3)
            parts.append((1.0 - share) * direction + share * directions[k + 1] + shake)
            at += count
    force = np.concatenate(parts)
    output = per_g * (force @ response.T + bias) + noise * rng.normal(size=force.shape)
    return Recording(rate, np.arange(at) / rate, output, spans, directions, per_g, noise)


def counts(rng: np.random.Generator, **how: object) -> Recording:
    """The same as whole numbers of a converter."""
    one = recording(rng, **how)
    return Recording(one.rate, one.time, np.round(one.output), one.spans, one.directions, one.per_g, one.noise)


def table(one: Recording, **more: object) -> pd.DataFrame:
    """Columns t, ax, ay, az."""
    frame = pd.DataFrame({"t": one.time, "ax": one.output[:, 0], "ay": one.output[:, 1], "az": one.output[:, 2]})
    return frame.assign(**more)
