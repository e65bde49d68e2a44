"""The basis of a verdict: degrees of freedom, condition number, influence of single dwells, smallest detectable effect."""

from dataclasses import dataclass

import numpy as np

from inertial import effects as catalogue
from inertial.arrays import Array
from inertial.counts import degrees_of_freedom, number_of
from inertial.criticism.field import Candidates
from inertial.distributions import f_noncentrality, f_upper
from inertial.estimation.bases import SEEN, unit_columns
from inertial.estimation.model import Model
from inertial.estimation.term import Term

FEWEST_DOF = 9
"""Degrees of freedom needed for a verdict if the noise is known from the residuals only: 18 positions of unknown orientation.

Of 80 lots of 18 random positions with white noise of 0.3 mg 73 are adequate, 4 cannot be judged, 3 are not adequate (4 %); with
a cubic term of 10 mg/g³ 18 of 20 are not adequate and 11 name it, of 20 positions 18 and 15. "Adequate" is stated with the
smallest detectable cubic term (FEW_DOF), which is large.
"""

FEW_DOF = 60
"""Degrees of freedom below which "adequate" is stated with the smallest detectable cubic term."""

GROSS = 0.02
"""Residual, g rms, above the noise of any usable sensor: larger ones refute the model even with few dwells."""

SMOOTH = 1e4
"""Share of random walk from which dwells without recorded noise are taken to be samples of a movement.

A walk of 8 µg/√s over an hour beside 10 µg of white noise has 2300."""

POWER = 0.5
"""Detection probability of the smallest cubic term."""

_LEVEL = 0.05
_SMALLEST, _LARGEST = 1e-9, 1.0  # g/g³


@dataclass(frozen=True)
class Evidence:
    """The basis of a verdict.

    dof : degrees of freedom of the residuals; condition : condition number of the scaled columns, worst block
    bias_spread : g, jackknife standard deviation of the bias, worst axis; bias_change : g, its largest change by one dwell
    carrier : unit and dwell of that change; largest : largest studentised residual of a dwell, with unit and dwell
    cubic : g/g³, smallest cubic coefficient detected with a probability of one half; None if there is none
    """

    dof: int
    condition: float
    bias_spread: float | None
    bias_change: float | None
    carrier: tuple[int, int] | None
    largest: tuple[float, int, int] | None
    cubic: float | None


def evidence(model: Model, field: Candidates) -> Evidence:
    """The evidence behind the verdict on a model."""
    space = model.space
    spread, change, carrier = _by_dwell(model)
    return Evidence(
        dof=space.dof,
        condition=condition(model),
        bias_spread=spread,
        bias_change=change,
        carrier=carrier,
        largest=_largest(model),
        cubic=_cubic(model, field),
    )


def not_judged(model: Model, rms: float) -> str:
    """The reason why a verdict cannot be given; empty if it can."""
    space = model.space
    if rms > GROSS:
        return ""
    if not np.isfinite(space.rss) or not np.isfinite(rms):
        return "the residuals are undefined: the orientations do not determine the model; add poses in between"
    if space.dof < FEWEST_DOF:
        count = model.problem.count
        return (
            f"{number_of(count, 'measurement')} and {number_of(count - space.dof, 'coefficient')} leave "
            f"{degrees_of_freedom(space.dof)}, {FEWEST_DOF} are needed; "
            f"measure {number_of(FEWEST_DOF - space.dof, 'more dwell')}, or judge a smaller model"
        )
    lot = model.problem.lot
    if lot.radial and not lot.recorded and model.noise.shares.walk >= SMOOTH:
        return (
            "the residual varies smoothly from dwell to dwell, as in samples of a movement, dwells at rest are needed; "
            "import the samples to find the stretches at rest, or state sd_x, sd_y, sd_z and n of each dwell"
        )
    return ""


def condition(model: Model) -> float:
    """Largest singular value of the whitened columns of unit length over the smallest that the plan determines; worst block."""
    local = model.space.local
    if local.shape[-1] == 0:
        return 1.0
    values = np.linalg.svd(unit_columns(local)[0], compute_uv=False)
    seen = np.where(values > 1e-4 * values[:, :1], values, np.inf)
    return float(np.max(values[:, 0] / seen.min(axis=1)))


def _by_dwell(model: Model) -> tuple[float | None, float | None, tuple[int, int] | None]:
    """Jackknife standard deviation of the bias, g, its largest change, g, by leaving out a dwell, and that unit and dwell."""
    columns = next((at for term, at in model.slices(shared=False) if term.effect.id == "bias"), None)
    if columns is None:
        return None, None, None
    space, axes = model.space, model.problem.per_unit
    unit, size = unit_columns(space.local)
    inverse = (np.linalg.pinv(unit, rcond=1e-5) / size[..., None])[:, columns]
    off = _deleted(model)[0]
    moved = space.backed(np.swapaxes(inverse, -1, -2)) * off[:, None]
    count = np.maximum(np.count_nonzero(off, axis=1), 2)
    spread = np.sqrt((count - 1.0) / count * np.sum(moved**2, axis=2).max(axis=1))
    each = np.abs(moved).max(axis=1)
    block = int(np.argmax(spread))
    if spread[block] <= 0.0:
        return 0.0, 0.0, (0, 0)
    return float(spread[block]), float(each[block].max()), (block // axes, int(np.argmax(each[block])))


def _deleted(model: Model) -> tuple[Array, Array]:
    """Deletion residual of each dwell, (blocks, n), g, and the same over its standard error."""
    space = model.space
    left, size = space.deleted
    known = space.covariance.there & (size > 1e-9 * size.max(axis=1, keepdims=True))
    size = np.where(known, size, 1.0)
    return np.where(known, left / size, 0.0), np.where(known, left / np.sqrt(size), 0.0)


def _largest(model: Model) -> tuple[float, int, int] | None:
    """The dwell with the largest externally studentised residual: the residual, its unit and its dwell."""
    space, axes = model.space, model.problem.per_unit
    blocks = space.local.shape[0]
    each = _deleted(model)[1]
    squares = (each**2).reshape(blocks // axes, axes, -1).sum(axis=1)
    unit, dwell = np.unravel_index(int(np.argmax(squares)), squares.shape)
    rest = space.dof - axes
    if rest < 1:
        return None
    variance = max(space.rss - float(squares[unit, dwell]), 1e-300) / rest
    return float(np.sqrt(squares[unit, dwell] / axes / variance)), int(unit), int(dwell)


def _cubic(model: Model, field: Candidates) -> float | None:
    """Smallest detectable cubic coefficient, g/g³, by the noncentral F distribution over all tests; None if there is none."""
    if any(t.effect.id == "third_order" for t in model.terms):
        return None
    effect = catalogue.get("third_order")
    space, term = model.space, Term(effect)
    columns = model.problem.candidate(effect, [dict(term.values)]).at(0)
    after = space.project(space.whiten(columns))
    rank = int(space.gain(term.candidate(model.problem)).rank[0])
    left = space.dof - rank
    if rank == 0 or left < 2:
        return None
    power = np.einsum("bnp,bnp->p", after, after) / max(space.variance, 1e-300)
    power = power[power > SEEN**2]
    limit = float(f_upper(_LEVEL / max(len(field.effects), 1), rank, left))
    if not power.size:
        return None
    size = float(np.sqrt(f_noncentrality(POWER, limit, rank, left) / power.min()))
    return size if _SMALLEST < size < _LARGEST else None
