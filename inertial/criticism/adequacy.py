"""Is the model good enough for the noise that is there: the largest of many tests, against its own distribution."""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy import stats

from inertial.criticism.drivers import Driver
from inertial.criticism.penalty import log_p_value
from inertial.criticism.search import Candidates
from inertial.criticism.space import SEEN, Candidate, Space

Array = NDArray[np.float64]

_DRAWS = 400
_FEWEST = 60
_NUMBERS = 10_000_000
"""Random numbers drawn at the most: large lots get fewer draws."""

_CLEAR = np.log(1e-4)


def adequacy(field: Candidates, drivers: list[Driver], space: Space, rng: Generator) -> float:
    """Natural logarithm of the probability that an adequate model fits as badly somewhere, over all looks together.

    The look that fails most is compared with the most failing look of noise drawn from the fitted covariance; a failure far
    beyond what draws can show is charged with the number of looks instead.
    """
    worst, looks = 0.0, 0
    for candidate in _everything(field, drivers):
        gain = space.gain(candidate)
        looks += gain.drop.size
        tested = [log_p_value(space, float(d), int(r)) for d, r in zip(gain.drop, gain.rank, strict=True)]
        worst = min(worst, *tested)
    charged = worst + np.log(max(looks, 1))
    if charged < _CLEAR:
        return float(charged)
    drawn = _worst_of_noise(_everything(field, drivers), space, rng)
    beyond = float(np.mean(drawn <= worst))
    return float(np.log(max(beyond, 0.5 / drawn.size)))


def _everything(field: Candidates, drivers: list[Driver]) -> Iterator[Candidate]:
    yield from field.pieces()
    yield from (d.candidate for d in drivers)


def _worst_of_noise(candidates: Iterable[Candidate], space: Space, rng: Generator) -> Array:
    """Smallest log p over all looks for each draw of noise, (draws,)."""
    blocks, n = space.targets.shape[:2]
    draws = int(np.clip(_NUMBERS // (blocks * n), _FEWEST, _DRAWS))
    noise = rng.standard_normal((blocks, n, draws))
    noise = noise - space.q[0] @ (np.swapaxes(space.q[0], -1, -2) @ noise)
    total = np.einsum("bnd,bnd->d", noise, noise)
    worst = np.zeros(draws)
    for candidate in candidates:
        for drop, rank in _drops(candidate, space, noise):
            after = space.dof - rank
            if rank and after > 0:
                ratio = (drop / rank) / (np.maximum(total - drop, 1e-300) / after)
                worst = np.minimum(worst, stats.f.logsf(ratio, rank, after))
    return worst


def _drops(candidate: Candidate, space: Space, noise: Array) -> list[tuple[Array, int]]:
    """For every value of the nonlinear parameters: what the candidate takes off each draw, and its rank."""
    blocks, n, grid, p = candidate.columns.shape
    flat = (candidate.columns / space.spread[..., None, None]).reshape(blocks, n, grid * p)
    size = np.sqrt(np.einsum("bnm,bnm->bm", flat, flat))
    q = space.q[0]
    left = flat - q @ (np.swapaxes(q, -1, -2) @ flat)
    found: list[tuple[Array, int]] = []
    if candidate.shared:
        left = left.reshape(blocks * n, grid, p) / np.sqrt(np.sum(size.reshape(blocks, grid, p) ** 2, axis=0))
        noise_flat = noise.reshape(blocks * n, -1)
        for g in range(grid):
            u, s, _ = np.linalg.svd(left[:, g], full_matrices=False)
            along = u[:, s > SEEN].T @ noise_flat
            found.append((np.sum(along**2, axis=0), int(np.count_nonzero(s > SEEN))))
        return found
    unit = (left / np.where(size > 0.0, size, 1.0)[:, None, :]).reshape(blocks, n, grid, p)
    for g in range(grid):
        columns = unit[:, :, g]
        values, vectors = np.linalg.eigh(np.swapaxes(columns, -1, -2) @ columns)
        seen = values > SEEN**2
        whole = columns @ (vectors * np.where(seen, 1.0 / np.sqrt(np.where(seen, values, 1.0)), 0.0)[:, None, :])
        along = np.swapaxes(whole, -1, -2) @ noise
        found.append((np.einsum("bpd,bpd->d", along, along), int(seen.sum())))
    return found
