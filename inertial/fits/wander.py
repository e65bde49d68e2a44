"""Generalised least squares of a lot: dwell means that carry white noise, and wander between the dwells.

White-noise standard errors sd/√n leave out that a real output wanders from dwell to dwell; fitted with them alone, the
errors of the coefficients come out several times too small. Here the covariance of the dwell means is white + 1/f +
random walk, the strengths estimated by restricted maximum likelihood over all units and axes of the lot, and
coefficients, errors and residuals follow from it. A unit and axis that the model fits far worse than the others takes no
part in the noise, and has its errors widened by its own lack of fit (Birge ratio; GUM type B).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from inertial.arrays import Array, Flags, Index
from inertial.design import Values
from inertial.distributions import chi2_quantile, chi2_upper, normal_tail, student_upper
from inertial.errors import NotIdentified
from inertial.fits.generalised import SHARES, Series, Solved
from inertial.fits.linear import LotFit, fit_lot
from inertial.fits.prior import Combined
from inertial.fits.wander_columns import LotColumns
from inertial.noise.flicker import SLOWEST_FITTED, flicker_kernel
from inertial.noise.measurands import walk_kernel
from inertial.state import State

_LACKING = 1e-4
"""Probability, over all units and axes, below which the scatter of one is lack of fit and not noise."""

_FLICKER, _HALVINGS = 1e4, 24
"""Largest share of flicker over the white variance that is looked at, and steps to find the one that explains the scatter."""

_KEPT_TIMES = 400
"""Dwells up to which kernels are stored: each has the square of their number."""

_COMMON = 2.0
"""Variance of the common residual over that of the units' noise, from which on the noise is looked for without it."""

_REFUTED = 4.0
"""Deviance by which flicker must be worse than white noise to be out of the question."""


@dataclass(frozen=True)
class WanderFit:
    """A fit with the noise that it found.

    noise : (..., n, 3), standard deviation of the noise of one dwell, white and wander, output unit
    expected : (..., n, 3), standard deviation that the residual of each dwell should have, output unit
    predicted : (..., 3, m, m), covariance of the residuals of the m dwells that were left out, output unit squared: their noise,
        what of it the fit's own dwells show, and the coefficients together
    lack_of_fit : (..., 3), variance of a unit and axis over that of the lot's noise where it is significant, else one
    nonlinear_error : standard errors of nonlinear parameters that were given, by effect id
    """

    fit: LotFit
    """Coefficients with covariance and chi-square under white noise and wander."""
    white: float
    """Standard deviation of the white part of a dwell mean over the standard error given; 1 if sd/√n is right."""
    flicker_share: float
    """Variance of the 1/f wander over that of the white part."""
    walk_share: float
    """Variance that a random walk gathers over the whole record, over that of the white part."""
    noise: Array
    expected: Array
    predicted: Array
    lack_of_fit: Array
    nonlinear_error: dict[str, dict[str, float]]
    walk_shown: bool
    """Whether the record shows the walk: no flicker alone explains it as well."""
    gain: Array
    """(..., 3, p, n): derivative of the coefficients by every output of the n fitted dwells."""
    widened: float
    """Factor of the errors of the coefficients where the noise is known from few degrees of freedom; one elsewhere."""
    of_prior: Array | None = None
    """(..., 3, p): share of the prior in the variance of every coefficient; None without a prior."""

    @property
    def flicker(self) -> float:
        """Standard deviation of the 1/f wander, in standard errors of a dwell as given."""
        return self.white * float(np.sqrt(self.flicker_share))

    @property
    def walk(self) -> float:
        """Standard deviation of the random walk at the end of the record, in standard errors of a dwell as given."""
        return self.white * float(np.sqrt(self.walk_share))


def wander_kernels(time: Array, used: Flags | None = None) -> tuple[Array, Array]:
    """Covariances (n, n) of 1/f wander and random walk of variance one at times (n,), s.

    Wander slower than the record is, for the record, the bias itself. Kernels of a short record are stored, because fit and
    budget of a lot need the same ones. The walk is counted from its mean over the dwells that are used.
    """
    there = np.ones(time.size, dtype=bool) if used is None else used
    if time.size > _KEPT_TIMES:
        return flicker_kernel(time, slowest=SLOWEST_FITTED), walk_kernel(time, there)
    return _kept_kernels(np.asarray(time, dtype=np.float64).tobytes(), there.tobytes())


@lru_cache(maxsize=4)
def _kept_kernels(times: bytes, used: bytes) -> tuple[Array, Array]:
    time = np.frombuffer(times)
    kernels = flicker_kernel(time, slowest=SLOWEST_FITTED), walk_kernel(time, np.frombuffer(used, dtype=bool))
    for kernel in kernels:
        kernel.setflags(write=False)
    return kernels


def fit_lot_with_wander(  # noqa: PLR0913 - what a fit needs, and what of it is known already
    effects: Sequence[str],
    state: State,
    output: Array,
    standard_error: Array,
    *,
    nonlinear: Values | None = None,
    used: Flags | None = None,
    plain: LotFit | None = None,
    missing: Flags | None = None,
    believed: Callable[[Array, Array], Combined] | None = None,
) -> WanderFit:
    """Generalised least-squares fit of a model to the dwells of a lot.

    Parameters
    ----------
    effects : ids of the model
    state : the dwells, measured at the same times by all units
    output : (..., n, 3), mean output of each dwell, output unit
    standard_error : (..., n, 3), sd/√n, output unit; every one finite and positive
    nonlinear : values of nonlinear parameters that were found on the same dwells; their errors enter those of the coefficients
    used : (n,), the dwells that are fitted; the others only have residuals. All where None
    plain : the fit of these dwells under white noise alone, where it is known
    missing : (units, n), dwells that a unit lacks, with any finite outputs and errors; None where all have all
    believed : combines coefficients (..., 3, p) and their covariance with a prior

    Raises
    ------
    NotIdentified
        The plan cannot determine a coefficient, or there are too few dwells for the noise.
    """
    if not np.all(np.isfinite(standard_error) & (standard_error > 0.0)):
        raise NotIdentified(
            "wander: a standard error is zero or infinite; give each dwell the resolution of its output"
        )
    error = np.broadcast_to(standard_error, output.shape)
    there = np.ones(output.shape[-2], dtype=bool) if used is None else used
    if plain is None:
        known = there if missing is None else there & ~missing
        plain = fit_lot(effects, state, output, np.where(known[..., None], error, np.inf), nonlinear=nonlinear)
    if np.any(plain.dof <= 0):
        raise NotIdentified(
            f"wander: {int(there.sum())} dwells for {plain.coefficients.shape[-1]} coefficients per axis leave nothing to "
            "judge the noise by; add poses or temperatures"
        )
    columns = LotColumns(plain, state, nonlinear or {})
    z, error = np.swapaxes(output, -1, -2), np.swapaxes(error, -1, -2)
    level = np.sqrt(np.mean(error[..., there] ** 2, axis=-1, keepdims=True))
    profile = np.sqrt(np.mean((error / level) ** 2, axis=tuple(range(error.ndim - 1))))
    time = np.reshape(np.broadcast_to(state.time, error[..., 0, :].shape), (-1, error.shape[-1]))[0]
    kernels = wander_kernels(time, there)
    cut = tuple(k[np.ix_(there, there)] for k in kernels)
    shared = columns.shared / level[..., None]
    gaps = None if missing is None else missing[..., there]
    series = Series(
        columns.local[..., there, :], shared[..., there, :], (z / level)[..., there], profile[there], cut, gaps
    )
    shares, solved = _solve(series)
    stretch = lack_of_fit(solved.squares / solved.variance, series.dof)
    covariance = np.diag(profile**2) + sum(s * k for s, k in zip(shares, kernels, strict=True))
    # nonlinear parameters stay as given: what a step of theirs would take off goes back to the other coefficients
    station, steps = np.split(solved.shared, [columns.station])
    back = shared[..., there, columns.station :] @ steps
    theta = (solved.theta + np.einsum("...pn,...n->...p", solved.gain, back)) * level
    inside = np.einsum("...np,...p->...n", columns.local, theta) + columns.shared[..., : columns.station] @ station
    wide = np.sqrt(solved.variance * stretch)[..., None] * level
    known = _known(series, shares, solved)
    theta_covariance = _covariance(shared[..., there, :], solved) * (known * wide[..., None]) ** 2
    apart = _apart(((z - inside) / level)[..., there], gaps)
    if apart is not None:
        alone = Series(columns.local[..., there, :], shared[..., there, :0], apart, profile[there], cut, gaps)
        alone.sound = series.sound
        theta_covariance = theta_covariance * _widening(alone, solved.gain, theta_covariance / level[..., None] ** 2)
    of_prior = None
    if believed is not None:
        both = believed(theta, theta_covariance)
        inside = inside + np.einsum("...np,...p->...n", columns.local, both.coefficients - theta)
        of_fit, back = both.of_fit, np.swapaxes(both.of_fit, -1, -2)
        rest = (both.covariance - of_fit @ theta_covariance @ back) / (known * wide[..., None]) ** 2
        solved = replace(solved, gain=of_fit @ solved.gain, inverse=of_fit @ solved.inverse @ back + rest)
        theta, theta_covariance, of_prior = both.coefficients, both.covariance, both.share
    left = _ResidualCovariance(columns.local, shared, solved, covariance, there)
    weighted = replace(
        plain,
        coefficients=theta,
        covariance=theta_covariance,
        shared=station,
        shared_covariance=known**2 * solved.variance * solved.shared_inverse[: columns.station, : columns.station],
        residuals=np.swapaxes(z - inside, -1, -2),
        chi2=solved.squares / solved.variance,
    )
    return WanderFit(
        fit=weighted,
        white=float(np.sqrt(solved.variance)),
        flicker_share=shares[0],
        walk_share=shares[1],
        noise=np.swapaxes(wide * np.sqrt(np.diagonal(covariance)), -1, -2),
        expected=np.swapaxes(wide * left.spread(), -1, -2),
        predicted=left.predicted() * (known * wide[..., None]) ** 2,
        lack_of_fit=stretch,
        nonlinear_error=columns.errors(solved),
        walk_shown=_shown(series, shares[1]),
        gain=np.broadcast_to(solved.gain, (*theta.shape, int(there.sum()))),
        widened=known,
        of_prior=of_prior,
    )


def _apart(residuals: Array, gaps: Flags | None) -> Array | None:
    """The residuals (units, 3, n) without what the units have in common, where that is more than noise; None elsewhere.

    Errors of the station are alike in all units. Larger than the noise of quiet devices they are taken for its white part, and
    flicker that does not average out is missed: the bias over temperature of such lots held 87 % in intervals of 95 %.
    """
    units = residuals.shape[0] if residuals.ndim > 2 else 1
    if units == 1:
        return None
    if gaps is not None:  # of the units that have the dwell
        residuals = np.where(gaps[:, None, :], np.nan, residuals)
        residuals = np.where(np.isnan(residuals), np.nanmean(residuals, axis=0), residuals)
    common = residuals.mean(axis=0)
    apart = (residuals - common) * np.sqrt(units / (units - 1))
    return apart if units * np.mean(common**2) > _COMMON * np.mean(apart**2) else None


def _widening(alone: Series, gain: Array, covariance: Array) -> Array:
    """Factors (..., 3, p, p) that bring variances up to those by the noise of the units alone; one on the diagonal elsewhere.

    Parameters
    ----------
    gain : (..., 3, p, n), of the fit; covariance : (..., 3, p, p), over the square of the level of the noise
    """
    shares, found = _solve(alone)
    noise = found.variance * alone.covariance(shares)
    instead = np.einsum("...pn,...pn->...p", gain @ noise, gain)
    wider = np.sqrt(np.maximum(instead / np.diagonal(covariance, axis1=-2, axis2=-1), 1.0))
    return np.asarray(wider[..., :, None] * wider[..., None, :])


def lack_of_fit(chi2: Array, dof: Index | int) -> Array:
    """Birge ratio squared of every block, where its scatter is more than noise of the lot's size makes; one elsewhere."""
    far = _quantiles(lambda degrees: _exceeded(_LACKING / chi2.size, degrees), dof)
    return np.where(chi2 <= far, 1.0, chi2 / dof)  # what is no number stays none


def _quantiles(of: Callable[[int], float], dof: Index | int) -> Array:
    """A number of the χ² of each block; most blocks have equal degrees of freedom."""
    every, where = np.unique(dof, return_inverse=True)
    return np.array([of(degrees) for degrees in every.tolist()])[where].reshape(np.shape(dof))


def _solve(series: Series) -> tuple[tuple[float, float], Solved]:
    """Shares of wander and the solution at them, the noise from the blocks that the model fits like the rest.

    The scatter of the samples is a lower bound: where less than it is left, the fit is the weighted one.
    """
    shares, solved = _prudent(series, series.best_shares())
    middle = np.median(solved.squares / _quantiles(lambda degrees: float(chi2_quantile(0.5, degrees)), series.dof))
    lacking = lack_of_fit(solved.squares / middle, series.dof) > 1.0
    if lacking.any() and not lacking.all():
        series.sound = ~lacking
        shares, solved = _prudent(series, series.best_shares())
    if solved.variance * (1.0 + sum(shares)) < 1.0:
        shares = (0.0, 0.0)
        solved = replace(series.solve(shares), variance=1.0)
    return shares, solved


def _shown(series: Series, walk: float) -> bool:
    """Whether flicker alone is worse than with this share of a walk by what refutes it."""
    if walk <= 0.0:
        return False
    without, with_walk = np.min(series.deviances(np.array(SHARES), np.array([0.0, walk])), axis=0)
    return bool(without - with_walk >= _REFUTED)


def _prudent(series: Series, shares: tuple[float, float]) -> tuple[tuple[float, float], Solved]:
    """The shares and the solution at them; flicker in place of white noise that is larger than the dwells' own samples show.

    Few dwells do not tell the kind of their scatter. Taken for white it would average out in the bias, which flicker does not
    (the bias of six faces was wrong by eight of its standard errors): it counts as flicker, unless the likelihood is against it.
    """
    solved = series.solve(shares)
    if any(shares) or not _scattered(series, solved):
        return shares, solved
    low, high = 0.0, np.log1p(_FLICKER * solved.variance)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if series.solve((float(np.expm1(middle)), 0.0)).variance > 1.0 else (low, middle)
    flicker = (float(np.expm1(high)), 0.0)
    instead = series.solve(flicker)
    return (flicker, instead) if instead.deviance - solved.deviance < _REFUTED else (shares, solved)


def _scattered(series: Series, solved: Solved) -> bool:
    """Whether the dwells of the sound blocks scatter by more than their own samples show."""
    dof = int(series.dof[series.sound].sum())
    return solved.variance * dof > _exceeded(_LACKING, dof)


@lru_cache(maxsize=1024)
def _exceeded(probability: float, dof: int) -> float:
    """The χ² of ``dof`` degrees of freedom that is exceeded with a probability."""
    return float(chi2_upper(probability, dof))


def _known(series: Series, shares: tuple[float, float], solved: Solved) -> float:
    """Factor of the errors where the noise is known from the scatter of a few dwells; one where the samples give it."""
    if not any(shares) and not _scattered(series, solved):
        return 1.0
    return student(int(series.dof[series.sound].sum()) - solved.shared.size)


@lru_cache(maxsize=1024)
def student(dof: int) -> float:
    """What widens a standard error known from so many degrees of freedom, so that k = 2 covers 95.45 % (JCGM 100, G.3)."""
    return 0.5 * float(student_upper(normal_tail(2.0), max(dof, 1)))


def _covariance(shared: Array, solved: Solved) -> Array:
    """Covariance (..., 3, p, p) of the blocks' coefficients over the variance, that of the shared ones within it."""
    if not solved.shared.size:
        return solved.inverse + np.zeros((*solved.theta.shape, 1))
    across = solved.gain @ shared
    return solved.inverse + across @ solved.shared_inverse @ np.swapaxes(across, -1, -2)


@dataclass(frozen=True)
class _ResidualCovariance:
    """What a fit leaves, over the variance of the white part: with y = Hθ + v and θ̂ = θ + G·v the residual is v − H·G·v.

    h : (..., 3, n, p); s : (..., 3, n, q), of parameters that all share, which add their errors to predictions
    covariance : (n, n), of the noise; there : (n,), the dwells of the fit
    """

    h: Array
    s: Array
    solved: Solved
    covariance: Array
    there: Flags

    def spread(self) -> Array:
        """Standard deviations of the residuals of all dwells, (..., 3, n)."""
        with_used = np.matmul(self.solved.gain, self.covariance[self.there])
        square = np.diagonal(self.covariance) - 2.0 * np.einsum("...np,...pn->...n", self.h, with_used)
        square = square + np.sum(np.matmul(self.h, self.solved.inverse) * self.h, axis=-1)
        return np.sqrt(np.maximum(square, 0.0))

    def predicted(self) -> Array:
        """Covariance (..., 3, m, m) of the residuals of the dwells that are left out."""
        out = ~self.there
        h, s = self.h[..., out, :], self.s[..., out, :]
        cross = np.matmul(h, np.matmul(self.solved.gain, self.covariance[np.ix_(self.there, out)]))
        square = self.covariance[np.ix_(out, out)] - cross - np.swapaxes(cross, -1, -2)
        square = square + np.matmul(h, np.matmul(self.solved.inverse, np.swapaxes(h, -1, -2)))
        if self.solved.shared.size:
            left = s - np.matmul(h, self.solved.gain @ self.s[..., self.there, :])
            square = square + left @ self.solved.shared_inverse @ np.swapaxes(left, -1, -2)
        return square
