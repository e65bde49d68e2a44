"""The shares of 1/f and of random walk, looked for on a lattice by restricted likelihood."""

from collections.abc import Callable

import numpy as np

from inertial.criticism.covariance import Shares
from inertial.criticism.decisions import LARGEST_SHARE, LEAST_SHARE, SHARE_STEP

Place = tuple[int | None, int | None]

_STRIDES = (4, 2, 1)
"""Half decades, quarters, eighths."""


def best_shares(deviance: Callable[[Shares], float], near: Shares | None = None, *, finest: int = 1) -> Shares:
    """The shares at which a deviance is least, walked to from a start.

    Parameters
    ----------
    near : where to begin; 1/f of three times the white variance where None
    finest : smallest stride, in eighths of a decade
    """
    known: dict[Place, float] = {}

    def at(place: Place) -> float:
        if place not in known:
            known[place] = deviance(shares_at(place))
        return known[place]

    here = (4, None) if near is None else place_of(near)
    for stride in _STRIDES:
        if stride < finest:
            break
        for _ in range(40):
            around = sorted(_around(here, stride), key=_order)
            best = min(around, key=at)
            if at(best) >= at(here):
                break
            here = best
    return shares_at(here)


def place_of(shares: Shares) -> Place:
    """The place of the lattice nearest to shares."""
    first, second = (None if s <= 10.0 ** ((LEAST_SHARE - 4) / SHARE_STEP) else _inside(round(SHARE_STEP * np.log10(s))) for s in shares)
    return first, second


def shares_at(place: Place) -> Shares:
    """The shares of a place of the lattice."""
    flicker, walk = (0.0 if k is None else 10.0 ** (k / SHARE_STEP) for k in place)
    return Shares(flicker, walk)


def _inside(k: int) -> int:
    return min(max(k, LEAST_SHARE), LARGEST_SHARE)


def _around(place: Place, stride: int) -> set[Place]:
    """Neighbours, each share up or down, one for the other, or gone."""
    first, second = (_moves(k, stride) for k in place)
    near = {(a, place[1]) for a in first} | {(place[0], b) for b in second}
    near |= {(a, b) for a in first[1:3] for b in second[1:3]}
    # a share that is not there yet only shows where it is as large as the other
    if place[1] is None and place[0] is not None:
        near |= {(place[0], place[0]), (_inside(place[0] - 8), place[0])}
    if place[0] is None and place[1] is not None:
        near |= {(place[1], place[1]), (place[1], _inside(place[1] - 8))}
    return near - {place}


def _moves(k: int | None, stride: int) -> list[int | None]:
    """None, down, up."""
    if k is None:
        return [None, None, LEAST_SHARE + 8] if stride > 1 else [None, None, LEAST_SHARE]
    down = k - stride
    return [None, down if down >= LEAST_SHARE else None, _inside(k + stride)]


def _order(place: Place) -> tuple[int, int]:
    first, second = (-100 if k is None else k for k in place)
    return first, second
