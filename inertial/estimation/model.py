"""A model under criticism: its columns in a problem, and the noise of its residuals."""

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from inertial.arrays import Array
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
"""Part of the scatter of norms that their white noise has at the least, where that recorded in the samples is larger."""

_CONTRADICTED = 0.025
"""Probability of so little scatter of norms, below which the recorded noise is not that of the means."""


_TURNS = 3
"""Rounds in which blocks with shares of their own and the shares of the others are found in turn."""

_OWN = 20
"""Degrees of freedom of a block from which on its own variance is used for the shares; blocks with fewer have a common one."""


class Model:
    """Terms in a problem.

    Parameters
    ----------
    near : noise at which the search for this model's noise starts
    curves, shared_curves : (blocks, n, d), columns of a driver that is not an effect, sized by block or for all blocks
    known : list that holds the noise of a model of these terms once it is found
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
        """Columns with coefficients of all blocks, (blocks, n, q)."""
        columns = [t.columns(self.problem) for t in self.terms if t.shared]
        if self._shared_curves is not None:
            columns.append(self._shared_curves)
        if not columns:
            return np.zeros((self.problem.blocks, self.problem.n, 0))
        columns += [t.start(self.problem) for t in self.terms if t.shared]
        return np.concatenate(columns, axis=-1)

    def slices(self, *, shared: bool) -> list[tuple[Term, slice]]:
        """Terms whose coefficients all blocks share, or do not, and where their columns are; unknown states and curves follow."""
        terms = [t for t in self.terms if t.shared == shared]
        ends = np.cumsum([0, *(t.columns(self.problem).shape[-1] for t in terms)]).tolist()
        return [(term, slice(start, end)) for term, start, end in zip(terms, ends[:-1], ends[1:], strict=True)]

    def at(self, noise: Noise) -> Space:
        """The residuals of the model, whitened for a noise; the spaces of its own noise and of the last other one are stored."""
        if noise is self.__dict__.get("noise"):
            return self.space
        if self._last is None or self._last.noise is not noise:
            self._last = self._space(noise)
        return self._last

    def _space(self, noise: Noise) -> Space:
        return Space(self.problem.covariance, noise, self.problem.y, self.local, self.shared)

    @cached_property
    def noise(self) -> Noise:
        """Shares of wander by restricted likelihood, pooled over the blocks, and variances of the blocks."""
        if not self._found:
            self._found.append(self.noise_at(self._best_shares()))
            self._spaces.clear()
        return self._found[0]

    def _best_shares(self) -> Shares:
        """Shares of the smallest restricted deviance; blocks whose wander is of another kind have their own."""
        near = None if self._near is None else self._near.shares
        finest = 4 if self.problem.n > _LONG else 2
        best = best_shares(self._restricted, near, finest=finest)
        for _ in range(_TURNS):
            space = self._rough(best)
            series = self.problem.y if not self.shared.shape[-1] else self.problem.y - self.shared @ space.shared_sizes
            by_block = own_shares(self.problem, series, self.local, space, self._by_products(best))
            if by_block == best.by_block:
                break
            # the others without them, from where they were
            best = best_shares(self._restricted, best._replace(by_block=by_block), finest=finest)
        return best

    def forget(self) -> None:
        """Drop what is stored for models that follow: for a large lot it takes much memory."""
        self._spaces.clear()
        self._last = None
        for name in ("space", "_statistics", "_even"):
            self.__dict__.pop(name, None)

    def plausible_shares(self) -> list[tuple[Shares, float]]:
        """Shares that the residuals do not rule out, with weights that add up to one."""
        return plausible_shares(self._restricted, self.noise.shares)

    def noise_at(self, shares: Shares) -> Noise:
        """The noise at given shares: each block's variance shrunk towards the others as far as they are similar."""
        space = self._rough(shares)
        squares, prior = moderated(space.squares, space.by_block)
        return Noise(shares, np.sqrt(np.maximum(squares, self._least)), prior)

    @cached_property
    def _least(self) -> Array:
        """Variances (blocks,) over the recorded white ones below which those of a norm cannot be; zero where nothing is known.

        White noise of the samples is a lower bound. Few dwells that fit well by chance otherwise pass for strong wander with less
        white noise than their samples have, and errors are stated too small where the scatter is small by chance. A record that
        scatters less than chance allows, as where a vibration averages out in its means, has a lower bound of its own.
        """
        lot = self.problem.lot
        if not (lot.radial and lot.recorded):
            return np.zeros(self.problem.blocks)
        space = self._space(self.problem.covariance.white_noise())
        dof = np.maximum(space.by_block, 1.0)
        contradicted = space.squares < chi2_quantile(_CONTRADICTED, dof)
        return np.where(contradicted, _SHARE_OF_SCATTER * space.squares / dof, 1.0)

    def _rough(self, shares: Shares) -> Space:
        """The space at shares, with the blocks weighted by their known variances."""
        if shares not in self._spaces:
            if len(self._spaces) >= (2 if self.problem.y.size <= LARGE else 1):  # a search for shares seldom goes back
                del self._spaces[next(iter(self._spaces))]
            self._spaces[shares] = self._space(Noise(shares, self._weights))
        return self._spaces[shares]

    @cached_property
    def _weights(self) -> Array:
        """Standard deviations by which the blocks weigh while the shares are searched, (blocks,)."""
        if self._near is not None:
            return self._near.scale
        if not self._joined:
            return np.ones(self.problem.blocks)
        # the variances under white noise, for columns that all share
        space = self._space(self.problem.covariance.white_noise())
        return np.sqrt(moderated(space.squares, space.by_block)[0])

    def _restricted(self, shares: Shares) -> float:
        """−2 log restricted likelihood, each block with its own variance if it has enough degrees of freedom."""
        known = self._known.of_lot.get(shares)
        if known is None:
            known, firm = self._deviance(shares)
            if firm:
                self._known.of_lot[shares] = known
        return known

    def _deviance(self, shares: Shares) -> tuple[float, bool]:
        """The deviance of :meth:`_restricted`, and whether it holds for all models of equal terms.

        By the products of the columns if these are precise, else in the whitened space.
        """
        quick = self._statistics.left(shares, self._weights)
        if quick is None:
            space = self._rough(shares)
            return self._deviance_of(shares, space.information, space.squares, space.by_block), False
        dof = self.problem.covariance.count - float(self._statistics.rank)
        return self._deviance_of(shares, quick.information, quick.squares, dof), self._alike and quick.firm

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
        """−2 log restricted likelihood of a block at shares, less the log-determinant; None if products are not precise enough.

        What all blocks share has the coefficients that it has at the best shares.
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
                if self._alike and left.firm:
                    self._known.of_blocks[block, shares] = known
            return known

        return deviance

    @property
    def _joined(self) -> bool:
        """Whether all blocks share some coefficients."""
        return self.shared.shape[-1] > 0

    @property
    def _alike(self) -> bool:
        """Whether the restricted likelihood depends on the terms alone: no weights, and no curve, are in it."""
        return not self._joined and self._curves is None

    @cached_property
    def _known(self) -> KnownDeviances:
        """The deviances that are known."""
        return (
            self.problem.deviances.setdefault(frozenset(term.key for term in self.terms), KnownDeviances())
            if self._alike
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
        """RMS, g, that the noise of the measurement, white and wander, leaves in the residuals of least squares.

        The residuals of a correct model have it; what of the noise looks like coefficients is in their uncertainty. A noise that
        the shares describe badly (a beat with the mains is bounded, a random walk is not) is no more than the residuals hold.
        """
        covariance, space = self.problem.covariance, self.even
        shared = space.targets[..., 1:]
        common = orthonormal(shared.reshape(1, shared[..., 0].size if shared.size else 0, shared.shape[-1]))[0]
        left, held = covariance.squares_left(self.noise, space.q, common.reshape(shared.shape), space.residual)
        if self.problem.y.size > LARGE:
            del self.even
        return float(np.sqrt(max(min(left, held), 0.0) / max(int(covariance.count.sum()), 1)))

    def scatter(self) -> float:
        """RMS of the noise of a dwell mean against its neighbours, g: white, and the wander from dwell to dwell.

        Of a random walk :meth:`floor` has what it does over the whole record, this what it does between two dwells.
        """
        covariance = self.problem.covariance
        wander = covariance.side_by_side(self.noise.shares)
        each = (self.noise.scale * covariance.level) ** 2 * (1.0 + wander)
        return float(np.sqrt(np.sum(each * covariance.count) / max(int(covariance.count.sum()), 1)))

    def shared_sizes(self, term: Term) -> Array:
        """Coefficients (k,) of a term that all blocks share."""
        for other, columns in self.slices(shared=True):
            if other.key == term.key:  # a model that was kept has an equal term
                return self.space.shared_sizes[columns]
        raise KeyError(f"{term.effect.id}: not a term of the model")

    def explained(self, candidate: Candidate, floor: float) -> float:
        """RMS, g, of the part of a candidate that the model cannot absorb, less that of noise of RMS ``floor``."""
        covariance = self.problem.covariance
        gain = self.even.gain(candidate)
        if self.problem.y.size > LARGE:
            del self.even
        beyond = float(gain.drop[0]) * covariance.white - floor**2 * float(gain.rank[0])
        return float(np.sqrt(max(beyond, 0.0) / self.problem.count))

    @cached_property
    def even(self) -> Space:
        """The space in which all blocks have equal weight: of the lot's white noise."""
        covariance = self.problem.covariance
        return self._space(Noise(Shares(), np.sqrt(covariance.white) / covariance.level))

    def _variant(
        self,
        terms: Sequence[Term],
        curves: Array | None = None,
        shared_curves: Array | None = None,
        known: list[Noise] | None = None,
    ) -> "Model":
        """Another model near this one; curves are kept unless others are given."""
        return Model(
            self.problem,
            terms,
            near=self.noise,
            curves=self._curves if curves is None else curves,
            shared_curves=self._shared_curves if shared_curves is None else shared_curves,
            known=known,
        )

    def with_term(self, term: Term) -> "Model":
        """The model with one more term; its noise is kept, as a term is fitted, judged and sized one after the other."""
        return self._variant([*self.terms, term], known=self._noises.setdefault(term.key, []))

    def with_curves(self, columns: Array) -> "Model":
        """The model with the columns (blocks, n, d) of a driver, sized by block."""
        return self._variant(self.terms, curves=columns)

    def held_at(self, shares: Shares) -> "Model":
        """The model with the noise of given shares, as it is and not estimated."""
        curves, common = self._curves, self._shared_curves
        known = [self.noise_at(shares)]
        return Model(self.problem, self.terms, near=self._near, curves=curves, shared_curves=common, known=known)

    def with_shared_curves(self, columns: Array) -> "Model":
        """The model with the columns (blocks, n, d) of a driver, whose coefficients all blocks share."""
        return self._variant(self.terms, shared_curves=columns)

    def without(self, effect_id: str) -> "Model":
        """The model less one effect."""
        return self._variant([t for t in self.terms if t.effect.id != effect_id])

    def without_term(self, term: Term) -> "Model":
        """The model less one term; a model that was kept holds an equal one."""
        return self._variant([t for t in self.terms if t.key != term.key])


def refuse_without_freedom(model: Model) -> None:
    """Refuse to judge a model that has as many coefficients as there are measurements: it fits any data.

    Raises
    ------
    NotIdentified
        No degree of freedom is left.
    """
    if model.even.dof < 1:
        count, series = model.problem.count, model.problem.blocks
        raise NotIdentified(
            f"model: {count // series} dwells a unit leave no degree of freedom to judge the model, more dwells than its "
            "coefficients on an axis are needed; measure more poses or repeats, or judge a smaller model"
        )
