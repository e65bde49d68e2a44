"""Single bad dwells, identified by their deletion residuals.

With P = V⁻¹ − V⁻¹H(HᵀV⁻¹H)⁻¹HᵀV⁻¹ the deletion residual of a dwell is (Py)_i/P_ii, and (Py)_i²/P_ii over its variance is
chi-square: no further fit is needed. Deletion identifies the dwell; robust weights would change all dwells and identify none.
"""

import numpy as np

from inertial.arrays import Array, Flags, Places
from inertial.data_errors.bad_norms import bad_norms
from inertial.data_errors.removed_dwells import BadDwell, model_without
from inertial.decisions import BAD_DWELL, COMMON, MOST_BAD
from inertial.distributions import chi2_tail, chi2_upper, f_tail
from inertial.estimation.alternative import poses
from inertial.estimation.model import Model
from inertial.estimation.space import Space

_ROUNDS = 8
_ALIKE = 0.6
"""Share of the largest deviation in a round below which dwells are tested again only after the noise is estimated anew."""

_AT_LEAST = 2
"""Number of dwells that may always be left out of a record, however short it is."""

_SEVERAL = 3
"""Smallest number of units whose median distinguishes a wrong pose from a bad dwell; with fewer, repeated dwells of a pose do."""

_EVERY_TIME = 0.7
"""Smallest component of each dwell's deviation along the mean deviation of its pose, over that mean, if the pose is always off.

One bad dwell of three contributes a third of its deviation to the mean and leaves less than a tenth, of opposite sign, in each
of the others: it remains a bad dwell.
"""

_LEAST_DOF = 6
"""Degrees of freedom of a unit below which none of its dwells can be identified as bad."""


def bad_dwells(model: Model, *, of_all: bool = False) -> list[BadDwell]:
    """The dwells that disagree with a model and its noise; the noise is estimated again without them.

    Parameters
    ----------
    of_all : whether dwells that disagree in most units are included; otherwise they are left to the search for wrong poses
    """
    if model.problem.lot.radial:
        return bad_norms(model)
    bad: list[BadDwell] = []
    remaining = model
    for _ in range(_ROUNDS):
        most = max(int(MOST_BAD * model.problem.lot.state.time.size) + 1, _AT_LEAST)
        more = _round(remaining, most - len(bad), of_all=of_all)
        if not more:
            break
        bad += more
        remaining = model_without(remaining, [d.index for d in more])
    return bad


def any_of_all(model: Model) -> bool:
    """Whether any dwell disagrees in most units, beyond chance over all dwells."""
    if model.problem.lot.radial:
        return False
    deletion = _Deletion(model.space, model.problem.per_unit)
    if deletion.units < _SEVERAL:
        return False
    limit = float(chi2_upper(BAD_DWELL / deletion.n, deletion.axes))
    return bool(np.max(np.median(deletion.statistic(), axis=0)) > limit)


def _round(model: Model, most: int, *, of_all: bool) -> list[BadDwell]:
    """Outlying dwells at a fixed noise, the largest first, each deleted before the next is tested."""
    deletion = _Deletion(model.space, model.problem.per_unit, of_all=of_all)
    if deletion.units < _SEVERAL:
        deletion.left_to_poses = deletion.off_every_time(poses(model.problem.lot))
    bad: list[BadDwell] = []
    while len(bad) < most:
        worst = deletion.worst()
        if worst is None:
            break
        unit, dwell, by_axis = worst
        if bad and float(np.linalg.norm(by_axis)) < _ALIKE * bad[0].deviations:
            break
        bad.append(BadDwell(unit, dwell, deletion.delete(unit, dwell), by_axis))
    return bad


class _Deletion:
    """Deletion statistics of every dwell of every unit, updated as dwells are deleted one by one.

    left_to_poses : (n,), whether a dwell is left to the search for wrong poses
    of_all : whether dwells that disagree in most units are tested here instead
    """

    def __init__(self, space: Space, axes: int, *, of_all: bool = False) -> None:
        self.space, self.axes, self.of_all = space, axes, of_all
        blocks, n = space.residual.shape
        self.there = space.covariance.there.copy()
        self.units, self.n = blocks // axes, n
        scaled = space.noise.scale[:, None]
        # without the scale: the variance of each block is estimated again after each deletion
        self.left, self.size = (each * scaled**2 for each in space.deleted)
        self.squares, self.dof = space.squares.copy(), space.by_block.copy()
        if np.isfinite(space.noise.prior):
            # the prior's part of each block's variance
            self.centre = np.maximum(space.noise.scale**2 * (self.dof + space.noise.prior) - self.squares, 0.0)
        self.prior, self.looks = space.noise.prior, max(int(self.there.sum()) // axes, 1)
        self.left_to_poses = np.zeros(self.n, dtype=bool)

    @property
    def known(self) -> Flags:
        """Whether each dwell (blocks, n) is present and its prediction determined by the other dwells."""
        return self.there & (self.size > 1e-9 * self.size.max())

    @property
    def known_size(self) -> Array:
        """P_ii of the :attr:`known` dwells, (blocks, n); one elsewhere."""
        return np.where(self.known, self.size, 1.0)

    def off_every_time(self, pose: Places) -> Flags:
        """Whether each dwell (n,) has a pose (n,) whose dwells, at least two, all deviate by about the same."""
        there = np.asarray(self.known.reshape(self.units, self.axes, self.n).all(axis=1))
        off = np.where(self.known, self.left / self.known_size, 0.0)
        off = off.reshape(self.units, self.axes, self.n) * there[:, None]
        squares = self.statistic()
        of_pose = (pose == np.arange(int(pose.max()) + 1)[:, None]).astype(np.float64)
        count = of_pose @ there.sum(axis=0)
        mean = of_pose @ off.sum(axis=0).T / np.maximum(count, 1.0)[:, None]
        along = np.einsum("uan,na->un", off, mean[pose])
        alike = (along > _EVERY_TIME * np.sum(mean[pose] ** 2, axis=1)) & (
            squares > float(chi2_upper(COMMON, self.axes))
        )
        every = of_pose @ np.any(there & ~alike, axis=0) == 0.0
        several = of_pose @ there.any(axis=0) > 1.0
        return (every & several)[pose]

    def worst(self) -> tuple[int, int, Array] | None:
        """The most outlying dwell: unit, dwell, standardised deviations (axes,); None if none exceeds chance."""
        squares = self._squares()
        statistic = squares.sum(axis=1)
        if self.units >= _SEVERAL and not self.of_all:
            together = np.median(statistic, axis=0) > float(chi2_upper(COMMON, self.axes))
            statistic = np.where(together, 0.0, statistic)
        statistic = np.where(self.left_to_poses, 0.0, statistic)
        unit, dwell = np.unravel_index(int(np.argmax(statistic)), statistic.shape)
        dof = float(self.dof.reshape(self.units, -1).min(axis=1)[unit])
        largest, freedom = float(statistic[unit, dwell]), max(float(self.dof.sum()), 1.0)
        of_equal = f_tail(largest / self.axes, self.axes, freedom)
        chance = float(chi2_tail(largest, self.axes) if np.isfinite(self.prior) else of_equal) * self.looks
        outlier = int(unit), int(dwell), np.sqrt(squares[unit, :, dwell])
        return outlier if chance < BAD_DWELL and dof >= _LEAST_DOF else None

    def statistic(self) -> Array:
        """Chi-square of each dwell of each unit, (units, n)."""
        return self._squares().sum(axis=1)

    def _squares(self) -> Array:
        """Square of the deviation of each dwell by axis, over a variance estimated without the dwell, (units, axes, n).

        Over the few degrees of freedom of its block a deviation has Student's t, whose squares do not add up to F over the axes:
        its normal equivalent (Wallace, Ann. Math. Stat. 30 (1959) 1124) is given.
        """
        drop = np.where(self.known, self.left**2 / self.known_size, 0.0)
        by_axis = drop.reshape(self.units, self.axes, self.n)
        if np.isfinite(self.prior):
            rest = np.maximum(self.squares[:, None] - drop, 0.0) + self.centre[:, None]
            dof = np.maximum(self.dof - 1.0 + self.prior, 1.0)[:, None]
            normal = ((8.0 * dof + 1.0) / (8.0 * dof + 3.0)) ** 2 * dof * np.log1p(drop / np.maximum(rest, 1e-200))
            return normal.reshape(by_axis.shape)
        rest = float(self.squares.sum()) - by_axis.sum(axis=1, keepdims=True)
        return by_axis / np.maximum(rest / max(float(self.dof.sum()) - self.axes, 1.0), 1e-200)

    def delete(self, unit: int, dwell: int) -> Array:
        """Delete one dwell of a unit and update the statistics; returns its deletion residual, (axes,), g."""
        blocks = range(unit * self.axes, (unit + 1) * self.axes)
        off = np.array([self.left[b, dwell] / self.size[b, dwell] for b in blocks])
        for axis, b in enumerate(blocks):
            self.squares[b] -= self.left[b, dwell] ** 2 / self.size[b, dwell]
            self.dof[b] -= 1.0
            column = self.space.projector_at(b, dwell) * self.space.noise.scale[b] ** 2
            for gone in np.flatnonzero(~self.there[b] & self.space.covariance.there[b]).tolist():
                first = self.space.projector_at(b, gone) * self.space.noise.scale[b] ** 2
                column = column - first * float(first[dwell] / max(first[gone], 1e-300))
            self.left[b] -= column * off[axis]
            self.size[b] = np.maximum(self.size[b] - column**2 / max(float(column[dwell]), 1e-300), 0.0)
            self.there[b, dwell] = False
        return off


def deletion_residuals(model: Model) -> Array:
    """Standardised deletion residuals of all dwells and axes of a model, (m,), without dwells that are left out."""
    space = model.space
    deletion = _Deletion(space, model.problem.per_unit)
    scaled = deletion.left / np.sqrt(deletion.known_size) / space.noise.scale[:, None]
    return scaled[deletion.known]
