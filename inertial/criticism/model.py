"""A model under criticism: its columns in a problem, and the share of wander that its residuals show."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.problem import Problem
from inertial.criticism.space import Candidate, Space, information
from inertial.effects.base import AnyEffect
from inertial.errors import NotIdentified

Array = NDArray[np.float64]

_SHARES = np.concatenate([[0.0], np.geomspace(0.02, 2e4, 13)])


@dataclass(frozen=True)
class Term:
    """An effect in a model, at values of its nonlinear parameters.

    values : of nonlinear parameters and constants; one value, or one per sensor axis
    first : how many of its columns are used; None for all
    """

    effect: AnyEffect
    values: tuple[tuple[str, float | tuple[float, ...]], ...] = ()
    first: int | None = None

    @property
    def keywords(self) -> dict[str, float | tuple[float, ...]]:
        """Values as keywords of the effect's columns."""
        return dict(self.values)

    def candidate(self, problem: Problem) -> Candidate:
        """The term's columns in a problem, as something that a model may gain by."""
        return problem.candidate(self.effect, [self.keywords], first=self.first)


class Model:
    """Terms in a problem.

    Parameters
    ----------
    near : a share of wander near which this model's is looked for
    curves, shared_curves : (blocks, n, d), rotated columns of a driver that is no effect, sized by block or for all blocks
    """

    def __init__(
        self,
        problem: Problem,
        terms: Sequence[Term],
        *,
        near: float | None = None,
        curves: Array | None = None,
        shared_curves: Array | None = None,
    ) -> None:
        self.problem, self.terms, self._near = problem, tuple(terms), near
        self._curves, self._shared_curves = curves, shared_curves

    @cached_property
    def local(self) -> Array:
        """Rotated columns with coefficients by block, (blocks, n, p)."""
        found = [self._of(t) for t in self.terms if t.effect.scope != "station"]
        found += [self._start(t) for t in self.terms if t.effect.scope != "station"]
        if self._curves is not None:
            found.append(self._curves)
        if not found:
            return np.zeros((self.problem.blocks, self.problem.n, 0))
        return np.concatenate(found, axis=-1)

    @cached_property
    def shared(self) -> Array:
        """Rotated columns with coefficients of all blocks, (blocks, n, q)."""
        found = [self._of(t) for t in self.terms if t.effect.scope == "station"]
        if self._shared_curves is not None:
            found.append(self._shared_curves)
        if not found:
            return np.zeros((self.problem.blocks, self.problem.n, 0))
        found += [self._start(t) for t in self.terms if t.effect.scope == "station"]
        return np.concatenate(found, axis=-1)

    def _of(self, term: Term) -> Array:
        columns = self.problem.rotated(term.effect, term.keywords)
        return columns if term.first is None else columns[..., : term.first]

    def _start(self, term: Term) -> Array:
        """Rotated columns of the unknown state of a term's memory before the first dwell."""
        columns = self.problem.start(term.effect, term.keywords)
        return self.problem.basis.rotate(columns) if columns.shape[-1] else columns

    def at(self, share: float) -> Space:
        """What the model leaves, whitened at a share of wander."""
        return Space(self.problem.basis, share, self.problem.y, self.local, self.shared)

    @cached_property
    def share(self) -> float:
        """ρ by restricted maximum likelihood, pooled over the blocks."""
        shares = _SHARES
        if self._near is not None:
            around = self._near * np.array([0.03, 0.1, 0.3, 0.6, 1.0, 1.6, 3.0]) if self._near > 0.0 else _SHARES[1:6]
            shares = np.concatenate([[0.0], np.minimum(around, _SHARES[-1] * np.linspace(1.0, 1.1, around.size))])
        found = np.array([self._deviance(s) for s in shares])
        best = int(np.argmin(found))
        if 0 < best < shares.size - 1 and shares[best - 1] > 0.0:
            return float(np.exp(_vertex(np.log(shares[best - 1 : best + 2]), found[best - 1 : best + 2])))
        return float(shares[best])

    def _deviance(self, share: float) -> float:
        space = self.at(share)
        return space.restricted(np.array(information(self.local, space.spread)))

    @cached_property
    def space(self) -> Space:
        """What the model leaves, whitened at its own share of wander."""
        return self.at(self.share)

    def floor(self) -> float:
        """RMS of the noise of a dwell mean, g: white and wander about the record's own mean."""
        basis, space = self.problem.basis, self.space
        # the constant part of the wander goes into the bias of the run and is no error of the dwells against each other
        slow = space.share * basis.wander_about_mean
        return float(np.sqrt(space.variance * basis.white * (1.0 + slow)))

    def explained(self, candidate: Candidate, floor: float) -> float:
        """RMS, g, of what a candidate explains that the model cannot absorb, less what noise of RMS ``floor`` would."""
        gain = self.at(0.0).gain(candidate)
        beyond = float(gain.drop[0]) * self.problem.basis.white - floor**2 * float(gain.rank[0])
        return float(np.sqrt(max(beyond, 0.0) / self.problem.count))

    def _variant(
        self, terms: Sequence[Term], curves: Array | None = None, shared_curves: Array | None = None
    ) -> "Model":
        """Another model near this one; curves are kept unless others are given."""
        return Model(
            self.problem,
            terms,
            near=self.share,
            curves=self._curves if curves is None else curves,
            shared_curves=self._shared_curves if shared_curves is None else shared_curves,
        )

    def with_term(self, term: Term) -> "Model":
        """The model with one more term."""
        return self._variant([*self.terms, term])

    def with_curves(self, columns: Array) -> "Model":
        """The model with the columns (blocks, n, d) of a driver, sized by block."""
        return self._variant(self.terms, curves=columns)

    def with_shared_curves(self, columns: Array) -> "Model":
        """The model with the columns (blocks, n, d) of a driver, whose coefficients all blocks share."""
        return self._variant(self.terms, shared_curves=columns)

    def without(self, effect_id: str) -> "Model":
        """The model less one effect."""
        return self._variant([t for t in self.terms if t.effect.id != effect_id])


def refuse_without_freedom(model: Model) -> None:
    """Refuse to judge a model that has as many coefficients as there are measurements: it fits anything, and tells nothing.

    Raises
    ------
    NotIdentified
        No degree of freedom is left.
    """
    if model.at(0.0).dof < 1:
        count, series = model.problem.count, model.problem.blocks
        raise NotIdentified(
            f"model: {count // series} dwells a unit leave nothing to judge the model by, more dwells than its coefficients on "
            "an axis are needed; measure more poses or repeats, or judge a smaller model"
        )


def _vertex(x: Array, y: Array) -> float:
    """Abscissa of the parabola through three points, kept between the outer two."""
    a = np.polyfit(x - x[1], y, 2)
    if a[0] <= 0.0:
        return float(x[1])
    return float(np.clip(x[1] - a[1] / (2.0 * a[0]), x[0], x[2]))
