"""Error and log density of a model on dwells left out, predicted with the noise that correlates them with the others.

With P = V⁻¹ − V⁻¹H(HᵀV⁻¹H)⁻¹HᵀV⁻¹ of all dwells, those of a fold B deviate by (P_BB)⁻¹(Py)_B, with covariance (P_BB)⁻¹: the
prediction from all others, with wander and the errors of the coefficients, without a second fit. Ordinary least squares on the
other dwells is biased under wander: both sides of a fold share it, and every slow effect is confirmed.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from inertial.criticism import decisions
from inertial.criticism.decisions import BLOCKS
from inertial.criticism.handling.base import soaks
from inertial.criticism.heldout import residuals
from inertial.criticism.model import Model
from inertial.criticism.noise import LONGEST
from inertial.criticism.problem import Problem

Array = NDArray[np.float64]
Kind = Literal["poses", "soaks", "blocks of time"]

_POSES = 6


@dataclass(frozen=True)
class LeftOut:
    """A model on dwells left out, by kind of fold.

    missed : by kind, (blocks, n) g, NaN where a dwell is missing or its fold cannot judge the model
    density : by kind, log density of what was left out; kinds with a fold that cannot judge the model are omitted
    """

    missed: dict[Kind, Array]
    density: dict[Kind, float]

    def rms(self, kinds: set[Kind] | None = None) -> float:
        """The worst RMS over the kinds that can judge the model, g; NaN where none can."""
        usable: list[Kind] = [k for k in self.density if kinds is None or k in kinds]
        return max((_rms(self.missed[k]) for k in usable), default=float("nan"))


def left_out(model: Model) -> LeftOut:
    """The prediction of dwells left out: poses in six folds, soaks one by one, six stretches of time."""
    if model.problem.n > LONGEST:
        return _without_wander(model)
    parts = _Parts(model)
    missed: dict[Kind, Array] = {}
    density: dict[Kind, float] = {}
    for kind, fold in _folds(model.problem).items():
        whole = np.full((model.problem.blocks, model.problem.n), np.nan)
        total, sound = 0.0, True
        for k in range(int(fold.max()) + 1):
            predicted = parts.predicted(fold == k)
            sound &= predicted is not None
            if predicted is not None:
                whole[:, fold == k], total = predicted[0], total + predicted[1]
        missed[kind] = whole
        if sound:
            density[kind] = total
    return LeftOut(missed, density)


def _without_wander(model: Model) -> LeftOut:
    """Poses left out by weighted least squares: for records so long that wander is not modelled."""
    problem = model.problem
    fold = _by_pose(problem)
    whole = np.full((problem.blocks, problem.n), np.nan)
    for k in range(int(fold.max()) + 1):
        whole[:, fold == k] = residuals(problem, model.terms, fold != k)[:, fold == k]
    return LeftOut({"poses": whole}, {"poses": 0.0})


class _Parts:
    """The matrix P of every block, and its change by columns that all blocks share."""

    def __init__(self, model: Model) -> None:
        space = model.space
        blocks, n = space.residual.shape
        self.there, self.level = space.covariance.there, space.covariance.level * space.noise.scale
        self.p, self.precision = np.empty((blocks, n, n)), np.empty((blocks, n))
        for members, whitener in space.covariance.whiteners(space.noise.shares):
            inverse = whitener.T @ whitener
            for b in members.tolist():
                along = space.q[b].T @ whitener
                self.p[b] = (inverse - along.T @ along) / self.level[b] ** 2
                self.precision[b] = np.diagonal(inverse) / self.level[b] ** 2
        self.py = np.einsum("bij,bj->bi", self.p, model.problem.y)
        z = model.shared
        size = np.sqrt(np.einsum("bnq,bnq->q", z, z))
        z = z / np.where(size > 0.0, size, 1.0)
        self.pz = np.einsum("bij,bjq->biq", self.p, z)
        self.inner = np.einsum("bnq,bnr->qr", z, self.pz)
        if z.shape[-1]:
            beta = np.linalg.lstsq(self.inner, np.einsum("bnq,bn->q", z, self.py), rcond=1e-10)[0]
            self.py = self.py - self.pz @ beta
        self.typical = [self._spread(b) for b in range(blocks)]

    def predicted(self, out: NDArray[np.bool_]) -> tuple[Array, float] | None:
        """Deviations (blocks, k) of the dwells ``out`` (n,) from their prediction, and their log density; None if undefined."""
        missed = np.full((len(self.p), int(out.sum())), np.nan)
        density = 0.0
        inner = self.inner.copy()
        right = np.zeros(inner.shape[0])
        held: list[tuple[int, NDArray[np.intp], Array, Array]] = []
        for b, there in enumerate(self.there):
            places = np.flatnonzero(out & there)
            if not places.size:
                continue
            own = self.p[b][np.ix_(places, places)]
            values, vectors = np.linalg.eigh(own * self.level[b] ** 2)
            if values[0] <= 1e-7 * values[-1]:
                return None
            inverse = (vectors / values) @ vectors.T * self.level[b] ** 2
            if not self._known(b, places, inverse):
                return None
            off = inverse @ self.py[b, places]
            density += 0.5 * float(np.sum(np.log(values / self.level[b] ** 2))) - 0.5 * places.size * np.log(
                2.0 * np.pi
            )
            density -= 0.5 * float(self.py[b, places] @ off)
            shared = self.pz[b, places]
            inner -= shared.T @ inverse @ shared
            right += shared.T @ off
            held.append((b, places, inverse @ shared, off))
        turn = np.zeros(right.shape)
        if right.size:
            values = np.linalg.eigvalsh(inner)
            if values[0] <= 1e-9 * max(float(np.trace(self.inner)), 1e-300):
                return None
            turn = np.linalg.solve(inner, right)
            density += 0.5 * float(np.linalg.slogdet(inner)[1] - np.linalg.slogdet(self.inner)[1])
            density -= 0.5 * float(right @ turn)
        where = np.cumsum(out) - 1
        for b, places, across, off in held:
            missed[b, where[places]] = off + across @ turn
        return missed, density

    def _known(self, block: int, places: NDArray[np.intp], inverse: Array) -> bool:
        """Whether the other dwells determine the model at these dwells: not much worse than with wander alone."""
        expected = np.sqrt(np.mean(np.diagonal(inverse)))
        alone = np.sqrt(np.mean(1.0 / self.precision[block, places]))
        wander = np.sqrt(self.typical[block])
        return bool(expected < decisions.FOLD_BLIND * max(float(alone), float(wander)))

    def _spread(self, block: int) -> float:
        """Variance of what the model leaves of a block: nothing that it predicts should be much worse."""
        there = self.there[block]
        values = np.linalg.eigvalsh(self.p[block][np.ix_(there, there)])
        seen = values[values > 1e-9 * values[-1]]
        return float(np.mean(1.0 / seen))


def _folds(problem: Problem) -> dict[Kind, NDArray[np.intp]]:
    """Fold of every dwell, (n,), by kind."""
    state = problem.lot.state
    n = problem.n
    folds: dict[Kind, NDArray[np.intp]] = {"poses": _by_pose(problem)}
    number = soaks(state)
    if number.max() > 0:
        folds["soaks"] = number
    order = np.argsort(state.time.reshape(-1, n)[0], kind="stable")
    stretch = np.empty(n, dtype=np.intp)
    stretch[order] = np.arange(n) * min(BLOCKS, n) // n
    folds["blocks of time"] = stretch
    return folds


def _by_pose(problem: Problem) -> NDArray[np.intp]:
    """Equal poses together; dwells in turn if no pose is repeated."""
    force = np.round(problem.lot.state.force[0], 3)
    pose = np.unique(force, axis=0, return_inverse=True)[1].reshape(-1)
    if pose.max() + 1 < 2 * _POSES:
        return np.arange(problem.n) % min(_POSES, problem.n)
    return (pose * 7) % _POSES  # neighbours on the sphere fall into different folds


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))
