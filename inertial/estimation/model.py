"""A model under criticism: its columns in a problem, and the noise of its residuals."""

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from inertial.arrays import Array
from inertial.counts import number_of
from inertial.distributions import chi2_quantile
from inertial.errors import NotIdentified
from inertial.estimation.bases import orthonormal
from inertial.estimation.candidate import Candidate
from inertial.estimation.covariance import LARGE
from inertial.estimation.noise_shares import Noise, Shares, deviance_of, moderated
from inertial.estimation.problem import KnownDeviances, Problem
from inertial.estimation.share_statistics import ShareStatistics
from inertial.estimation.shares import best_shares, own_shares, plausible_shares
from inertial.estimation.space import Space
from inertial.estimation.term import Term

_LONG = 400
"""Number of dwells above which shares are searched by half decades, because each whitener takes time and memory."""


_SHARE_OF_SCATTER = 0.5
"""Lower bound of the white variance of norms, over their observed variance, where the recorded white noise is larger."""

_CONTRADICTED = 0.025
"""Probability of an observed scatter of norms as small, below which the recorded noise is not that of the means."""


_TURNS = 3
"""Rounds that alternate between the common shares and the shares of single blocks."""

_OWN = 20
"""Median degrees of freedom of a block from which on the shares are estimated with a free variance for every block."""


class Model:
    """Terms in a problem.

    Parameters
    ----------
    near : noise at which the search for this model's noise starts
    curves, shared_curves : (blocks, n, d), columns of a driver that is not an effect, with coefficients by block or common to all
    known : cache shared by models of the same terms: empty, or the one noise that was estimated
    """

    def __init__(
        self,
        problem: Problem,
        terms: Sequence[Term],
        *,
        near: Noise | None = None,
        curves: Array | None = None,
        shared_curves: Array | None = None,
        known: list[Noise] | None = None,
    ) -> None:
        self.problem, self.terms, self._near = problem, tuple(terms), near
        self._curves, self._shared_curves = curves, shared_curves
        self._found = [] if known is None else known
        self._noises: dict[tuple[object, ...], list[Noise]] = {}
        self._spaces: dict[Shares, Space] = {}
        self._last: Space | None = None

    @cached_property
    def local(self) -> Array:
        """Columns with coefficients by block, (blocks, n, p)."""
        columns = [t.columns(self.problem) for t in self.terms if not t.shared]
        columns += [t.start(self.problem) for t in self.terms if not t.shared]
        if self._curves is not None:
            columns.append(self._curves)
        if not columns:
            return np.zeros((self.problem.blocks, self.problem.n, 0))
        return np.concatenate(columns, axis=-1)

    @cached_property
    def shared(self) -> Array:
        """Columns whose coefficients all blocks share, (blocks, n, q)."""
        columns = [t.columns(self.problem) for t in self.terms if t.shared]
        if self._shared_curves is not None:
            columns.append(self._shared_curves)
        if not columns:
            return np.zeros((self.problem.blocks, self.problem.n, 0))
        columns += [t.start(self.problem) for t in self.terms if t.shared]
        return np.concatenate(columns, axis=-1)

    def slices(self, *, shared: bool) -> list[tuple[Term, slice]]:
        """The terms with shared or with local coefficients, and the slices of their columns; initial states and curves follow."""
        terms = [t for t in self.terms if t.shared == shared]
        ends = np.cumsum([0, *(t.columns(self.problem).shape[-1] for t in terms)]).tolist()
        return [(term, slice(start, end)) for term, start, end in zip(terms, ends[:-1], ends[1:], strict=True)]

    def at(self, noise: Noise) -> Space:
        """The space of the model at a noise; those at the model's own noise and at the last other noise are stored."""
        if noise is self.__dict__.get("noise"):
            return self.space
        if self._last is None or self._last.noise is not noise:
            self._last = self._space(noise)
        return self._last

    def _space(self, noise: Noise) -> Space:
        return Space(self.problem.covariance, noise, self.problem.y, self.local, self.shared)

    @cached_property
    def noise(self) -> Noise:
        """Noise by restricted likelihood: shares of wander pooled over the blocks, and the variance of each block."""
        if not self._found:
            self._found.append(self.noise_at(self._best_shares()))
            self._spaces.clear()
        return self._found[0]

    def _best_shares(self) -> Shares:
        """Shares of smallest restricted deviance; blocks whose wander deviates clearly get shares of their own."""
        near = None if self._near is None else self._near.shares
        finest = 4 if self.problem.n > _LONG else 2
        best = best_shares(self._restricted, near, finest=finest)
        for _ in range(_TURNS):
            space = self._rough(best)
            series = self.problem.y if not self.shared.shape[-1] else self.problem.y - self.shared @ space.shared_sizes
            by_block = own_shares(self.problem, series, self.local, space, self._by_products(best))
            if by_block == best.by_block:
                break
            # the common shares again without these blocks, starting at the previous ones
            best = best_shares(self._restricted, best._replace(by_block=by_block), finest=finest)
        return best

    def forget(self) -> None:
        """Drop stored spaces and products: in a large lot they take much memory."""
        self._spaces.clear()
        self._last = None
        for name in ("space", "_statistics", "_even"):
            self.__dict__.pop(name, None)

    def plausible_shares(self) -> list[tuple[Shares, float]]:
        """Shares that the residuals do not rule out, with weights that add up to one."""
        return plausible_shares(self._restricted, self.noise.shares)

    def noise_at(self, shares: Shares) -> Noise:
        """The noise at given shares; each block's variance is shrunk towards those of the others as far as they agree."""
        space = self._rough(shares)
        squares, prior = moderated(space.squares, space.by_block)
        return Noise(shares, np.sqrt(np.maximum(squares, self._least)), prior)

    @cached_property
    def _least(self) -> Array:
        """Lower bounds (blocks,) of the variances of norms, over the recorded white variances; zero where none is known.

        The white noise of the samples is a lower bound. Without it, few dwells that agree by chance would be attributed to strong
        wander with less white noise than the samples have, and errors stated where the scatter is small by chance would be too
        small. A record that scatters less than chance allows, as where a vibration averages out in the means, has a lower bound
        from its observed scatter.
        """
        lot = self.problem.lot
        if not (lot.radial and lot.recorded):
            return np.zeros(self.problem.blocks)
        space = self._space(self.problem.covariance.white_noise())
        dof = np.maximum(space.by_block, 1.0)
        contradicted = space.squares < chi2_quantile(_CONTRADICTED, dof)
        return np.where(contradicted, _SHARE_OF_SCATTER * space.squares / dof, 1.0)

    def _rough(self, shares: Shares) -> Space:
        """The space at given shares, with each block weighted by its approximate variance (:attr:`_weights`)."""
        if shares not in self._spaces:
            if len(self._spaces) >= (2 if self.problem.y.size <= LARGE else 1):  # a search for shares seldom goes back
                del self._spaces[next(iter(self._spaces))]
            self._spaces[shares] = self._space(Noise(shares, self._weights))
        return self._spaces[shares]

    @cached_property
    def _weights(self) -> Array:
        """Standard deviations (blocks,) by which the blocks are weighted while the shares are searched."""
        if self._near is not None:
            return self._near.scale
        if not self._joined:
            return np.ones(self.problem.blocks)
        # with shared columns the blocks need relative weights: their variances under white noise
        space = self._space(self.problem.covariance.white_noise())
        return np.sqrt(moderated(space.squares, space.by_block)[0])

    def _restricted(self, shares: Shares) -> float:
        """−2 log restricted likelihood at given shares; each block has its own variance if the blocks have enough dwells."""
        known = self._known.of_lot.get(shares)
        if known is None:
            known, firm = self._deviance(shares)
            if firm:
                self._known.of_lot[shares] = known
        return known

    def _deviance(self, shares: Shares) -> tuple[float, bool]:
        """The deviance of :meth:`_restricted`, and whether it may be stored for all models of equal terms.

        It is computed from the products of the columns where these are precise, else in the whitened space.
        """
        quick = self._statistics.left(shares, self._weights)
        if quick is None:
            space = self._rough(shares)
            return self._deviance_of(shares, space.information, space.squares, space.by_block), False
        dof = self.problem.covariance.count - float(self._statistics.rank)
        return self._deviance_of(shares, quick.information, quick.squares, dof), self._terms_alone and quick.firm

    def _deviance_of(self, shares: Shares, information: float, squares: Array, dof: Array) -> float:
        logdet = float(np.sum(self.problem.covariance.logdet(shares)))
        if self._least.any():
            known = dof > 0
            level = np.maximum(squares[known] / dof[known], np.maximum(self._least[known], 1e-300))
            return logdet + information + float(np.sum(dof[known] * np.log(level) + squares[known] / level))
        if float(np.median(dof)) < _OWN:
            return logdet + information + deviance_of(squares, dof)
        known = dof > 0
        deviances = dof[known] * np.log(np.maximum(squares[known], 1e-300) / dof[known])
        return logdet + information + float(np.sum(deviances))

    def _by_products(self, best: Shares) -> Callable[[int, Shares], float | None]:
        """A function of block and shares: −2 log restricted likelihood of the block less its log-determinant.

        It returns None where products are not precise enough. Shared columns keep their coefficients at the shares ``best``.
        """
        beside = self._statistics.left(best, self._weights) if self._joined else None
        if self._joined and beside is None:
            return lambda _, __: None
        sizes = None if beside is None else beside.sizes

        def deviance(block: int, shares: Shares) -> float | None:
            known = self._known.of_blocks.get((block, shares))
            if known is None and (left := self._statistics.left_of_block(block, shares, sizes)) is not None:
                dof = int(self.problem.covariance.count[block]) - self._statistics.rank
                known = left.information + dof * float(np.log(max(float(left.squares[0]), 1e-300)))
                if self._terms_alone and left.firm:
                    self._known.of_blocks[block, shares] = known
            return known

        return deviance

    @property
    def _joined(self) -> bool:
        """Whether the model has coefficients that all blocks share."""
        return self.shared.shape[-1] > 0

    @property
    def _terms_alone(self) -> bool:
        """Whether the restricted likelihood depends on the terms alone, not on weights or curves."""
        return not self._joined and self._curves is None

    @cached_property
    def _known(self) -> KnownDeviances:
        """The store of deviances: common to all models of these terms in the problem where they depend on the terms alone."""
        return (
            self.problem.deviances.setdefault(frozenset(term.key for term in self.terms), KnownDeviances())
            if self._terms_alone
            else KnownDeviances()
        )

    @cached_property
    def _statistics(self) -> ShareStatistics:
        """Products of the columns and of the measurements, at any shares."""
        return ShareStatistics(self.problem, self.local, self.shared)

    @cached_property
    def space(self) -> Space:
        """The residuals of the model, whitened for its own noise."""
        return self._space(self.noise)

    def floor(self) -> float:
        """RMS, g, of the least-squares residuals expected from the noise of the measurement, white and wander.

        The residuals of a correct model have this RMS; noise absorbed by the coefficients is in their uncertainty. Where the
        shares describe the noise badly (a beat with the mains is bounded, a random walk is not), the value is limited to the RMS
        of the residuals.
        """
        covariance, space = self.problem.covariance, self.even
        shared = space.targets[..., 1:]
        common = orthonormal(shared.reshape(1, shared[..., 0].size if shared.size else 0, shared.shape[-1]))[0]
        left, held = covariance.squares_left(self.noise, space.q, common.reshape(shared.shape), space.residual)
        if self.problem.y.size > LARGE:
            del self.even
        return float(np.sqrt(max(min(left, held), 0.0) / max(int(covariance.count.sum()), 1)))

    def scatter(self) -> float:
        """RMS, g, of the noise of a dwell mean relative to its neighbours: white noise, and wander from dwell to dwell.

        A random walk contributes its steps between dwells here, and its excursion over the record to :meth:`floor`.
        """
        covariance = self.problem.covariance
        wander = covariance.side_by_side(self.noise.shares)
        each = (self.noise.scale * covariance.level) ** 2 * (1.0 + wander)
        return float(np.sqrt(np.sum(each * covariance.count) / max(int(covariance.count.sum()), 1)))

    def shared_sizes(self, term: Term) -> Array:
        """Coefficients (k,), g per unit of its columns, of a term that all blocks share."""
        for other, columns in self.slices(shared=True):
            if other.key == term.key:  # a stored model may hold an equal term instead of this object
                return self.space.shared_sizes[columns]
        raise KeyError(f"{term.effect.id}: not a term of the model")

    def explained(self, candidate: Candidate, floor: float) -> float:
        """RMS, g, of the fitted part of a candidate beyond the model, less that expected from noise of RMS ``floor``."""
        covariance = self.problem.covariance
        gain = self.even.gain(candidate)
        if self.problem.y.size > LARGE:
            del self.even
        beyond = float(gain.drop[0]) * covariance.white - floor**2 * float(gain.rank[0])
        return float(np.sqrt(max(beyond, 0.0) / self.problem.count))

    @cached_property
    def even(self) -> Space:
        """The space at the lot's mean white noise, in which all blocks have equal weight."""
        covariance = self.problem.covariance
        return self._space(Noise(Shares(), np.sqrt(covariance.white) / covariance.level))

    def _variant(
        self,
        terms: Sequence[Term],
        curves: Array | None = None,
        shared_curves: Array | None = None,
        known: list[Noise] | None = None,
    ) -> "Model":
        """A model of other terms whose noise search starts at this model's noise; its curves unless others are given."""
        return Model(
            self.problem,
            terms,
            near=self.noise,
            curves=self._curves if curves is None else curves,
            shared_curves=self._shared_curves if shared_curves is None else shared_curves,
            known=known,
        )

    def with_term(self, term: Term) -> "Model":
        """The model with one more term; its noise is stored, because fit, test and size of a term all need it."""
        return self._variant([*self.terms, term], known=self._noises.setdefault(term.key, []))

    def with_curves(self, columns: Array) -> "Model":
        """The model with the columns (blocks, n, d) of a driver, with coefficients by block."""
        return self._variant(self.terms, curves=columns)

    def held_at(self, shares: Shares) -> "Model":
        """The model at given shares of wander, which are not estimated."""
        curves, common = self._curves, self._shared_curves
        known = [self.noise_at(shares)]
        return Model(self.problem, self.terms, near=self._near, curves=curves, shared_curves=common, known=known)

    def with_shared_curves(self, columns: Array) -> "Model":
        """The model with the columns (blocks, n, d) of a driver, whose coefficients all blocks share."""
        return self._variant(self.terms, shared_curves=columns)

    def without(self, effect_id: str) -> "Model":
        """The model without an effect, given by its id."""
        return self._variant([t for t in self.terms if t.effect.id != effect_id])

    def without_term(self, term: Term) -> "Model":
        """The model without a term; terms are compared by their keys."""
        return self._variant([t for t in self.terms if t.key != term.key])


def refuse_without_freedom(model: Model) -> None:
    """Refuse to judge a model with as many coefficients as measurements: it fits any data.

    Raises
    ------
    NotIdentified
        No degree of freedom is left.
    """
    if model.even.dof < 1:
        count, series = model.problem.count, model.problem.blocks
        raise NotIdentified(
            f"model: {number_of(count // series, 'dwell')} a unit and no degree of freedom to judge the model, more dwells than "
            "its coefficients on an axis are needed; measure more poses or repeats, or judge a smaller model"
        )
