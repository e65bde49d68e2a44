"""Residual of a true effect after the fit of a wrong one, minimised over the nonlinear parameters of the wrong one.

Every grid value and values near the best are tried, for each truth separately. Each sensor axis has its own values where that
brings the reduction that the search requires (:data:`inertial.decisions.AXES_DIFFER`).
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from inertial.arrays import Array
from inertial.decisions import AXES_DIFFER
from inertial.design import grid_of
from inertial.effects.base import Nonlinear
from inertial.estimation.alternative import Handling
from inertial.estimation.bases import eigen, inverse_roots
from inertial.estimation.candidate import Candidate, times_rows
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise
from inertial.estimation.problem import Values
from inertial.estimation.refinement import around, cell, on_scale
from inertial.estimation.term import Term

TermValues = tuple[tuple[str, float | tuple[float, ...]], ...]

_JITTER = 1e-8
"""Relative eigenvalue of the scaled Gram matrix below which a direction is rounding error, as in the fits."""

_ROUNDS = 3
_AXES = 3


class LikelihoodProfile:
    """True effects outside a model, and the part of each that a wrong effect cannot explain.

    Parameters
    ----------
    rest : the model without the rivals
    targets : (blocks, n, r), g, contribution of each of r truths to the series
    noise : noise for the whitening
    by_axis : smallest reduction of the whitened sum of squares for separate values per axis; infinite: never
    """

    def __init__(self, rest: Model, targets: Array, noise: Noise, by_axis: float = AXES_DIFFER) -> None:
        self.problem, self.noise, self.by_axis = rest.problem, noise, by_axis
        self.space = rest.at(noise)
        self.targets = self.space.project(self.space.whiten(targets))
        shared = self.space.targets[..., 1:]
        size = np.sqrt(np.einsum("bnq,bnq->q", shared, shared))
        self.shared = shared / np.where(size > 0.0, size, 1.0)
        self._known: dict[Term, dict[TermValues, tuple[Array, Array | None]]] = {}

    @cached_property
    def whole(self) -> Array:
        """Whitened sum of squares (r,) of each truth after the model without any rival."""
        flat = self.targets.reshape(-1, self.targets.shape[-1])
        return _fit_squares(self.shared.reshape(flat.shape[0], -1), flat)

    def left(self, wrong: Term, *, fine: bool) -> Array:
        """Whitened sum of squares (r,) of each truth after the model with a wrong effect.

        Parameters
        ----------
        fine : whether values between those of the grid are tried, too
        """
        if isinstance(wrong.effect, Handling):
            raise TypeError(f"{wrong.effect.id}: a handling error has no parameters to fit again")
        state = self.problem.lot.state
        grid: list[Values] = [dict(v) for v in grid_of(wrong.effect, state)]
        parameters = [p for p in wrong.effect.parameters(state) if not p.choices]
        if wrong.values:
            grid += [{**grid[0], **wrong.keywords}]
        varied = parameters if fine else []
        least = self._least(wrong, grid, varied, None)
        if not parameters or self._residual_squares(wrong, grid)[1] is None:
            return least
        apart = np.sum([self._least(wrong, grid, varied, axis) for axis in range(_AXES)], axis=0)
        return np.where(least - apart > self.by_axis, apart, least)

    def _least(self, wrong: Term, grid: Sequence[Values], varied: Sequence[Nonlinear], axis: int | None) -> Array:
        """Smallest residual sums of squares (r,) of the truths over a grid of the wrong effect.

        Parameters
        ----------
        varied : parameters that are refined between grid values, one after the other
        axis : sensor axis whose residuals count; None for all axes
        """
        total, axes = self._residual_squares(wrong, grid)
        squares = total if axis is None or axes is None else axes[axis]
        best, least = [grid[int(k)] for k in np.argmin(squares, axis=0)], squares.min(axis=0)
        truths = range(len(best))
        for parameter in varied:
            width = cell(parameter)
            for _ in range(_ROUNDS):
                tried = [
                    {**best[r], parameter.name: float(v)}
                    for r in truths
                    for v in around(parameter, on_scale(parameter, _value(best[r], parameter, axis)), width)
                ]
                total, axes = self._residual_squares(wrong, tried)
                squares = total if axis is None or axes is None else axes[axis]
                count = len(tried) // len(best)
                for r in truths:
                    index = r * count + int(np.argmin(squares[r * count : (r + 1) * count, r]))
                    if squares[index, r] < least[r]:
                        best[r], least[r] = tried[index], squares[index, r]
                width *= 0.4
        return least

    def _residual_squares(self, wrong: Term, grid: Sequence[Values]) -> tuple[Array, Array | None]:
        """Residual sums of squares (g, r) at each set of values; and by sensor axis, (3, g, r), if coefficients are by block.

        Results are stored: truths and axes often have their minimum at the same values, and a round begins where the previous
        one ended.
        """
        known = self._known.setdefault(wrong, {})
        names = [tuple(values.items()) for values in grid]
        new = [name for name in dict.fromkeys(names) if name not in known]
        if new:
            total, axes = self._computed_squares(wrong, [dict(name) for name in new])
            known.update({name: (total[k], None if axes is None else axes[:, k]) for k, name in enumerate(new)})
        by_axis = [of_axes for name in names if (of_axes := known[name][1]) is not None]
        return np.stack([known[name][0] for name in names]), np.stack(by_axis, axis=1) if by_axis else None

    def _computed_squares(self, wrong: Term, grid: Sequence[Values]) -> tuple[Array, Array | None]:
        """The result of :meth:`_residual_squares`, computed."""
        candidate = self.problem.varied(wrong.effect, grid, first=wrong.first, start=True)
        if not wrong.shared:
            return self._squares_after_local(candidate)
        columns = candidate.of_blocks
        blocks, n, g, p = columns.shape
        white = self.space.whiten(columns.reshape(blocks, n, g * p))
        size = np.sqrt(np.einsum("bnm,bnm->m", white, white)).reshape(g, p)
        left = self.space.project(white).reshape(blocks, n, g, p) / np.where(size > 0.0, size, 1.0)
        flat = self.targets.reshape(blocks * n, -1)
        shared = self.shared.reshape(blocks * n, -1)
        squares = [
            _fit_squares(np.concatenate([shared, left[:, :, k].reshape(blocks * n, p)], axis=1), flat) for k in range(g)
        ]
        return np.array(squares), None

    @cached_property
    def _both(self) -> Array:
        """The truths and the columns that all blocks share, (blocks, n, r + q)."""
        return np.concatenate([self.targets, self.shared], axis=-1)

    @cached_property
    def _rows(self) -> Array:
        return self.space.backed(self._both)

    def _squares_after_local(self, candidate: Candidate) -> tuple[Array, Array | None]:
        """Residual sums of squares (g, r), and by axis (3, g, r), after a fit of columns with coefficients by block."""
        both = self._both
        r = self.targets.shape[-1]
        found = self.space.products(candidate)
        size = np.sqrt(np.where(found.squares > 0.0, found.squares, 1.0))
        gram = found.left / (size[..., :, None] * size[..., None, :])
        inside = times_rows(self._rows, candidate) / size[..., None]
        values, vectors = eigen(gram)
        along = np.einsum("bgps,bgpt->bgst", vectors, inside, optimize=True) * inverse_roots(values, _JITTER)[..., None]
        if not self.shared.shape[-1]:
            remaining = np.einsum("bnt,bnt->bt", both, both)[:, None, :] - np.sum(along**2, axis=2)
            remaining = np.maximum(remaining, 0.0)
            radial = self.problem.lot.radial
            axes = (
                None
                if radial or self.problem.per_unit < _AXES
                else np.stack([remaining[a::3].sum(axis=0) for a in range(_AXES)])
            )
            return remaining.sum(axis=0), axes
        products = np.einsum("bnt,bns->ts", both, both) - np.einsum("bgpt,bgps->gts", along, along, optimize=True)
        inner = np.linalg.pinv(products[:, r:, r:], rcond=_JITTER, hermitian=True)
        taken = np.einsum("gtq,gqs,gts->gt", products[:, :r, r:], inner, products[:, :r, r:], optimize=True)
        return np.maximum(np.einsum("gtt->gt", products[:, :r, :r]) - taken, 0.0), None


def _value(values: Values, parameter: Nonlinear, axis: int | None) -> float:
    value = values[parameter.name]
    if isinstance(value, tuple):
        return float(np.mean(value)) if axis is None else value[axis]
    return value


def _fit_squares(columns: Array, targets: Array) -> Array:
    """Residual sums of squares (r,) of targets (m, r) after a fit of columns (m, p)."""
    if columns.shape[1]:
        targets = targets - columns @ np.linalg.lstsq(columns, targets, rcond=1e-6)[0]
    return np.sum(targets**2, axis=0)
