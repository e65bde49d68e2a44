"""Cross-validation: error and log density of a model on dwells left out, with the noise that correlates them with the others.

With P = V⁻¹ − V⁻¹H(HᵀV⁻¹H)⁻¹HᵀV⁻¹ of all dwells, the residuals of a fold B left out are (P_BB)⁻¹(Py)_B, with covariance (P_BB)⁻¹:
the prediction from all other dwells, including wander and the errors of the coefficients, without a second fit. Ordinary least
squares on the other dwells is biased under wander: both sides of a fold share it, so that every slow effect would be confirmed.

Handling errors (a unit moved, the table slipped) belong to this run and not to the model: in every fold they keep the
coefficients fitted to all dwells, like corrections of the readings. Otherwise a fold on one side of a change would extrapolate
it. The term that is judged is predicted from the other dwells alone, also where it is a handling error.

The state of a memory before the first dwell also belongs to the run, and affects few dwells, often only the first. Dwells of a
fold that alone determine it are fitted in that fold, with and without the effect. Of all other dwells of a fold the outputs are
left out, but not the sequence of poses and temperatures, which is known.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular

from inertial import decisions
from inertial.arrays import Array, Flags, Places
from inertial.decisions import BLOCKS
from inertial.estimation.alternative import Handling, poses, soaks
from inertial.estimation.bases import orthonormal
from inertial.estimation.comparison import Fitting, rms
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import LONGEST
from inertial.estimation.problem import Problem
from inertial.estimation.term import Term

Kind = Literal["poses", "soaks", "blocks of time"]

_POSES = 6

_UNDETERMINED = 1e-7
"""Ratio of the eigenvalues of P_BB, smallest over largest, below which the other dwells do not determine the model."""

_SURELY = 1e-4
"""Lower bound of that ratio above which the eigenvalues of the single blocks need not be computed."""

_ALONE = 0.9
"""Share of a column's sum of squares in one fold above which the other dwells do not determine its coefficient."""


@dataclass(frozen=True)
class LeftOut:
    """Prediction errors of a model on dwells left out, by kind of fold.

    missed : by kind, (blocks, n), g, prediction errors; NaN where a dwell is missing, where its fold cannot judge the model, or
        where it determines a memory's initial state
    density : by kind, log predictive density; kinds with a fold that cannot judge the model are omitted
    """

    missed: dict[Kind, Array]
    density: dict[Kind, float]

    def rms(self, kinds: set[Kind] | None = None) -> float:
        """The worst RMS over the kinds that can judge the model, g; NaN where none can."""
        usable: list[Kind] = [k for k in self.density if kinds is None or k in kinds]
        return max((rms(self.missed[k]) for k in usable), default=float("nan"))


def left_out(model: Model, judged: Term | None = None, also: Sequence[Term] = ()) -> LeftOut:
    """Cross-validation of a model with three kinds of folds: poses in six folds, each soak, six intervals of time.

    Parameters
    ----------
    judged : the term that is judged; other handling errors keep the coefficients fitted to all dwells
    also : terms of models that are compared with this one, so that the same dwells are left out for all
    """
    if model.problem.n > LONGEST:
        return _without_wander(model, judged)
    parts = _Projector(model, judged)
    begun = _initial_state_columns(model.problem, {term.key: term for term in (*model.terms, *also)}.values())
    missed: dict[Kind, Array] = {}
    density: dict[Kind, float] = {}
    for kind, fold in _folds(model.problem).items():
        residuals = np.full((model.problem.blocks, model.problem.n), np.nan)
        total, sound = 0.0, True
        for k in range(int(fold.max()) + 1):
            out = (fold == k) & ~_determining(begun, fold == k)
            predicted = parts.predicted(out)
            sound &= predicted is not None
            if predicted is not None:
                residuals[:, out], total = predicted[0], total + predicted[1]
        missed[kind] = residuals
        if sound:
            density[kind] = total
    return LeftOut(missed, density)


def _initial_state_columns(problem: Problem, terms: Iterable[Term]) -> Array:
    """Unit-length columns (n, k) of the initial states of all memories, those of all blocks side by side."""
    flat = [np.moveaxis(t.start(problem), 1, 0).reshape(problem.n, -1) for t in terms]
    joined = np.concatenate([np.zeros((problem.n, 0)), *flat], axis=1)
    size = np.linalg.norm(joined, axis=0)
    return joined[:, size > 0.0] / size[size > 0.0]


def _determining(begun: Array, fold: Flags) -> Flags:
    """Whether each dwell (n,) is in the fold and needed to determine one of the unit-length columns (n, k)."""
    inside = np.where(fold[:, None], begun, 0.0)
    within = inside[:, np.sum(inside**2, axis=0) > _ALONE]
    return np.any(within**2 > (1.0 - _ALONE) / len(fold), axis=1)


def _without_wander(model: Model, judged: Term | None) -> LeftOut:
    """Cross-validation over poses by weighted least squares, for records too long for a model of wander."""
    problem = model.problem
    fold = _by_pose(problem)
    residuals = np.full((problem.blocks, problem.n), np.nan)
    keeps = _fixed(model, judged)
    series = problem.y
    if keeps.any():
        series = series - model.shared[..., keeps] @ model.space.shared_sizes[keeps]
    fitting = Fitting(problem, [t for t in model.terms if not _keeps(t, judged)])
    for k in range(int(fold.max()) + 1):
        residuals[:, fold == k] = fitting.left(series[..., None], fold != k)[:, fold == k, 0]
    return LeftOut({"poses": np.where(np.isfinite(problem.error), residuals, np.nan)}, {"poses": 0.0})


def _keeps(term: Term, judged: Term | None) -> bool:
    """Whether a term keeps the coefficients fitted to all dwells: a handling error, unless it is the judged term."""
    return isinstance(term.effect, Handling) and (judged is None or term.key != judged.key)


def _fixed(model: Model, judged: Term | None) -> Flags:
    """Whether each shared column (q,) of a model keeps its coefficient."""
    keeps = np.zeros(model.shared.shape[-1], dtype=bool)
    for term, columns in model.slices(shared=True):
        keeps[columns] = _keeps(term, judged)
    return keeps


class _Projector:
    """The matrix P of every block, for groups of blocks that share a whitener, and its change by shared columns."""

    def __init__(self, model: Model, judged: Term | None) -> None:
        space = model.space
        self.blocks = space.targets.shape[0]
        z = model.shared
        size = np.sqrt(np.einsum("bnq,bnq->q", z, z))
        white = space.targets / np.concatenate([np.ones(1), np.where(size > 0.0, size, 1.0)])
        rows = space.backed(white)
        py, pz = rows[:, 0], np.swapaxes(rows[:, 1:], -1, -2)
        inner = np.einsum("bnq,bnr->qr", white[..., 1:], white[..., 1:])
        if z.shape[-1]:
            py = py - pz @ np.linalg.lstsq(inner, np.einsum("bnq,bn->q", white[..., 1:], white[..., 0]), rcond=1e-10)[0]
        again = ~_fixed(model, judged)
        pz, self.inner = pz[..., again], inner[np.ix_(again, again)]
        level = space.covariance.level * space.noise.scale
        along = space.backed(space.q) * level[:, None, None]
        by_block = (along, level, py, pz, model.local)
        self.groups = [
            _Group(members, space.covariance.there[members[0]], whitener, *(each[members] for each in by_block))
            for members, whitener in space.covariance.whiteners(space.noise.shares)
        ]

    def predicted(self, out: Flags) -> tuple[Array, float] | None:
        """Prediction errors (blocks, k), g, of the k dwells in ``out`` (n,), and their log density; None if undefined."""
        missed = np.full((self.blocks, int(out.sum())), np.nan)
        density = 0.0
        inner = self.inner.copy()
        right = np.zeros(inner.shape[0])
        held: list[tuple[_Group, Places, _Fold]] = []
        for group in self.groups:
            dwells = np.flatnonzero(out & group.there)
            if not dwells.size:
                continue
            fold = group.left_out(dwells)
            if fold is None:
                return None
            py, pz = group.py[:, dwells], group.pz[:, dwells]
            density += 0.5 * (fold.log_det - fold.off.size * np.log(2.0 * np.pi) - float(np.sum(py * fold.off)))
            inner -= np.einsum("bkq,bkr->qr", pz, fold.across)
            right += np.einsum("bkq,bk->q", pz, fold.off)
            held.append((group, dwells, fold))
        turn = np.zeros(right.shape)
        if right.size:
            values, vectors = np.linalg.eigh(inner)
            if values[0] <= 1e-9 * max(float(np.trace(self.inner)), 1e-300):
                return None
            # adds the errors of the shared coefficients, estimated from the other dwells, to the prediction error
            half = vectors / np.sqrt(values)
            if any(fold.is_blind(np.mean(np.sum((fold.across @ half) ** 2, axis=-1), axis=-1)) for *_, fold in held):
                return None
            turn = np.linalg.solve(inner, right)
            density += 0.5 * float(np.linalg.slogdet(inner)[1] - np.linalg.slogdet(self.inner)[1])
            density -= 0.5 * float(right @ turn)
        where = np.cumsum(out) - 1
        for group, dwells, fold in held:
            missed[np.ix_(group.members, where[dwells])] = fold.off + fold.across @ turn
        return missed, density


@dataclass(frozen=True)
class _Fold:
    """A fold of dwells left out of blocks that share a whitener, predicted with the shared coefficients of all dwells.

    off : (b, k), g, (P_BB)⁻¹(Py)_B; across : (b, k, q), (P_BB)⁻¹(Pz)_B; log_det : sum of log|P_BB|
    expected : (b,), g², variance of a prediction; enough : (b,), g², variance from which on a prediction is useless
    """

    off: Array
    across: Array
    log_det: float
    expected: Array
    enough: Array

    def is_blind(self, more: Array | float = 0.0) -> bool:
        """Whether the prediction of any block is useless, with ``more`` (b,), g², added to its variance."""
        return not bool(np.all(self.expected + more < self.enough))


@dataclass
class _Group:
    """P of blocks that share a whitener: in units of their level P = S − AᵀA, with a common S = V⁻¹ and few rows A per block.

    members : (b,), blocks; there : (n,), whether a dwell is present; whitener : (n, n)
    along : (b, r, n), A; level : (b,), g; py : (b, n), pz : (b, n, q), P times the measurements and the shared columns, 1/g
    local : (b, n, p), g per unit of the coefficient, columns with coefficients by block
    """

    members: Places
    there: Flags
    whitener: Array
    along: Array
    level: Array
    py: Array
    pz: Array
    local: Array

    @cached_property
    def inverse(self) -> Array:
        """V⁻¹ of all dwells in units of the level, (n, n)."""
        return self.whitener.T @ self.whitener

    @cached_property
    def typical(self) -> Array:
        """Expected residual variance of each block, (b,), g²: a useful prediction is not much worse."""
        measured = np.flatnonzero(self.there)
        root = solve_triangular(self.whitener[np.ix_(measured, measured)], np.eye(measured.size), lower=True)
        # P⁺ = (I − UUᵀ)V(I − UUᵀ) with an orthonormal basis U of the columns
        basis, rank = orthonormal(self.local[:, measured])
        inside = np.einsum("bnp,bnp->b", root.T @ basis, root.T @ basis)
        return self.level**2 * (np.sum(root**2) - inside) / np.maximum(measured.size - rank, 1)

    def left_out(self, dwells: Places) -> _Fold | None:
        """The fold of some dwells (k,); None if the other dwells do not determine its prediction.

        (S − AᵀA)⁻¹ = S⁻¹ + S⁻¹Aᵀ(I − AS⁻¹Aᵀ)⁻¹AS⁻¹: one inverse for all blocks, and a small one for each.
        """
        precision = self.inverse[np.ix_(dwells, dwells)]
        values, vectors = np.linalg.eigh(precision)
        inverse = (vectors / values) @ vectors.T
        rows = self.along[:, :, dwells]
        turned = rows @ inverse
        small = np.eye(rows.shape[1]) - turned @ np.swapaxes(rows, -1, -2)
        remains, directions = np.linalg.eigh(small)
        least = remains.min(initial=1.0)
        if least * values[0] <= _SURELY * values[-1]:
            exact = np.linalg.eigvalsh(precision - np.swapaxes(rows, -1, -2) @ rows)
            if bool(np.any(exact[:, 0] <= _UNDETERMINED * exact[:, -1])):
                return None
        half = np.swapaxes(directions, -1, -2) @ turned / np.sqrt(remains)[..., None]
        expected = (np.trace(inverse) + np.einsum("brk,brk->b", half, half)) * self.level**2 / dwells.size
        alone = np.mean(1.0 / np.diagonal(precision)) * self.level**2
        right = np.concatenate([self.py[:, dwells, None], self.pz[:, dwells]], axis=-1)
        solved = inverse @ right + np.swapaxes(half, -1, -2) @ (half @ right)
        solved *= self.level[:, None, None] ** 2
        log_det = float(np.sum(np.log(remains)) + len(rows) * np.sum(np.log(values)))
        log_det -= 2.0 * dwells.size * float(np.sum(np.log(self.level)))
        enough = decisions.FOLD_BLIND**2 * np.maximum(alone, self.typical)
        fold = _Fold(solved[..., 0], solved[..., 1:], log_det, expected, enough)
        return None if fold.is_blind() else fold


def _folds(problem: Problem) -> dict[Kind, Places]:
    """Fold of every dwell, (n,), by kind."""
    state = problem.lot.state
    n = problem.n
    folds: dict[Kind, Places] = {"poses": _by_pose(problem)}
    number = soaks(state)
    if number.max() > 0:
        folds["soaks"] = number
    order = np.argsort(state.time.reshape(-1, n)[0], kind="stable")
    stretch = np.empty(n, dtype=np.intp)
    stretch[order] = np.arange(n) * min(BLOCKS, n) // n
    folds["blocks of time"] = stretch
    return folds


def _by_pose(problem: Problem) -> Places:
    """Fold (n,) of each dwell, equal poses in the same fold; dwells in turn if there are too few poses."""
    pose = poses(problem.lot)
    if pose.max() + 1 < 2 * _POSES:
        return np.arange(problem.n) % min(_POSES, problem.n)
    return (pose * 7) % _POSES  # neighbours on the sphere fall into different folds
