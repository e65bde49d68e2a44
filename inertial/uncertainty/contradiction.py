"""Whether a lot contradicts what is stated of errors that its units share: those of the table that turned them all.

Each unit takes up of an error J·δ what its own coefficients can imitate; the rest is common to all residuals, while noise differs
from unit to unit. With the columns J scaled to the stated standard uncertainties, δ ~ N(0, 1), and the residuals of all units
weighed by their noise, b = Σ Jᵀ·R·y ~ N(0, A + A·A), A = Σ Jᵀ·R·J, R taking the coefficients out (restricted likelihood,
Patterson and Thompson 1971). An influence that the coefficients imitate has no column in A, and nothing is said of it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincc, gammainccinv

from inertial.arrays import Array, Places
from inertial.noise.dwells import whitener

LEVEL = 0.005
"""p over all groups below which a contradiction is told.

The noise of the lot is estimated from the lot, so that honest lots fall below it more often: one in a hundred is told
(`python benchmarks/contradiction.py`, docs/reference/measured.md).
"""
TOLD = 0.9
"""Probability of being told at the size from which an influence counts as seen."""
FACTORS = np.geomspace(0.02, 200.0, 800)
"""Sizes over the stated one that are looked at; neighbours differ by 1.2 %."""
LEAST_INFORMATION = 1e-6
"""Least information of a direction that counts: below it, the stated errors move the lot by a thousandth of its noise."""
HALF_CHI2_95 = 1.9207
RIVAL = 2.0  # difference of log likelihood up to which two contributions are not told apart: a ratio of seven


@dataclass(frozen=True)
class CommonEvidence:
    """What the residuals of a lot show of q influences that all units share: A (q, q) and b (q,)."""

    information: Array
    projection: Array


@dataclass(frozen=True)
class Size:
    """Size of a contribution over the stated one.

    factor, low, high : by likelihood, with a 95 % interval; p_value : of so large a residual at the stated size
    seen_from : factor that is told with probability :data:`TOLD`; infinite where none is
    gain : of log likelihood against the stated size; rivals : contributions that explain the residual as well
    """

    name: str
    factor: float
    low: float
    high: float
    p_value: float
    seen_from: float
    gain: float
    rivals: tuple[str, ...] = ()


def common_evidence(columns: Array, changes: Array, left: Array, covariance: Array) -> CommonEvidence:
    """The evidence of a lot.

    Parameters
    ----------
    columns : (units, m, n, p), H, of m axes; changes : (units, n, m, q), J per stated uncertainty
    left : (units, n, 3), outputs or residuals; covariance : (units, 3, n, n), of the noise of every output
    """
    count = changes.shape[-1]
    information, projection = np.zeros((count, count)), np.zeros(count)
    for unit in range(len(left)):
        for axis in range(columns.shape[1]):
            white = whitener(covariance[unit, axis])
            base, _ = np.linalg.qr(white @ columns[unit, axis])
            change = white @ changes[unit, :, axis, :]
            change = change - base @ (base.T @ change)
            information += change.T @ change
            projection += change.T @ (white @ left[unit, :, axis])
    return CommonEvidence(information, projection)


def without(evidence: CommonEvidence, taken_out: Places) -> CommonEvidence:
    """The evidence on the other influences, these being free: what they can imitate is taken out."""
    if not taken_out.size:
        return evidence
    others = np.setdiff1d(np.arange(evidence.projection.size), taken_out)
    inverse = np.linalg.pinv(evidence.information[np.ix_(taken_out, taken_out)], hermitian=True)
    turn = evidence.information[np.ix_(others, taken_out)] @ inverse
    information = evidence.information[np.ix_(others, others)] - turn @ evidence.information[np.ix_(taken_out, others)]
    return CommonEvidence(information, evidence.projection[others] - turn @ evidence.projection[taken_out])


def sizes(
    evidence: CommonEvidence, groups: Mapping[str, Places], known: Mapping[str, float] | None = None
) -> list[Size]:
    """The size of every group of influences, the others being as large as stated; only groups that the lot shows anything of.

    Parameters
    ----------
    known : factors of groups that are larger than stated
    """
    columns, value = _independent(evidence)
    scaled = columns.copy()
    for name, factor in (known or {}).items():
        scaled[:, groups[name]] *= factor
    total = np.eye(len(value)) + scaled @ scaled.T
    out = []
    for name, members in groups.items():
        of_group = columns[:, members]
        if name not in (known or {}) and np.sum(of_group**2) > LEAST_INFORMATION:
            out.append((name, *_parts(total - scaled[:, members] @ scaled[:, members].T, of_group, value)))
    return [_size(name, strength, part, LEVEL / len(out)) for name, strength, part in out]


def contradictions(evidence: CommonEvidence, groups: Mapping[str, Places], looked: Sequence[Size]) -> list[Size]:
    """The groups that are larger than stated at :data:`LEVEL` over all groups, the likeliest first.

    Of several that explain one residual the likeliest is named, with those as likely as its rivals; the others are judged again
    with it at the size that was found.

    Parameters
    ----------
    looked : the :func:`sizes`
    """
    found: list[Size] = []
    while larger := [size for size in looked if probability(looked, size) < LEVEL and size.factor > 1.0]:
        best = max(larger, key=lambda size: size.gain)
        rivals = tuple(size.name for size in larger if size is not best and size.gain > best.gain - RIVAL)
        found.append(replace(best, rivals=rivals))
        looked = sizes(evidence, groups, {size.name: size.factor for size in found})
    return found


def probability(looked: Sequence[Size], named: Size | None = None) -> float:
    """Probability that an honest lot shows one of the groups so much larger than stated: the most striking, or a named one."""
    least = min((size.p_value for size in looked), default=1.0) if named is None else named.p_value
    return min(1.0, len(looked) * least)


def beyond(evidence: CommonEvidence, zero: Places, groups: Mapping[str, Places], found: Sequence[Size]) -> float:
    """Probability of the residual along some influences that are taken to be zero, groups being as large as they were found."""
    columns, value = _independent(evidence)
    rest = columns.copy()
    for size in found:
        rest[:, groups[size.name]] *= size.factor
    rest = np.delete(rest, zero, axis=1)
    strength, part = _parts(np.eye(len(value)) + rest @ rest.T, columns[:, zero], value)
    return _above(float(np.sum(strength * part**2)), strength)


def _independent(evidence: CommonEvidence) -> tuple[Array, Array]:
    """M (r, q) and w (r,) ~ N(0, 1 + M·Mᵀ): the evidence in directions of noise one."""
    values, vectors = np.linalg.eigh(evidence.information)
    informative = values > LEAST_INFORMATION
    root = np.sqrt(values[informative])
    return root[:, None] * vectors[:, informative].T, vectors[:, informative].T @ evidence.projection / root


def _parts(rest: Array, group: Array, value: Array) -> tuple[Array, Array]:
    """Variances κ of a group in directions in which all else has variance one, and the value in these directions."""
    white = whitener(rest)
    vectors, strength, _ = np.linalg.svd(white @ group, full_matrices=False)
    return strength**2, vectors.T @ (white @ value)


def _size(name: str, strength: Array, part: Array, level: float) -> Size:
    """Size of a group from its directions."""
    spread = 1.0 + FACTORS[:, None] ** 2 * strength
    likelihood = -0.5 * np.sum(np.log(spread) + part**2 / spread, axis=1)
    best = int(np.argmax(likelihood))
    inside = np.flatnonzero(likelihood > likelihood[best] - HALF_CHI2_95)
    stated = -0.5 * float(np.sum(np.log(1.0 + strength) + part**2 / (1.0 + strength)))
    weight = strength / (1.0 + strength) ** 2  # of the score: the most powerful test near the stated size
    p_value = _above(float(weight @ part**2), weight * (1.0 + strength))
    low, high = FACTORS[inside[0]], FACTORS[inside[-1]]
    return Size(
        name,
        factor=float(FACTORS[best]),
        low=float(low) if inside[0] > 0 else 0.0,
        high=float(high) if inside[-1] < FACTORS.size - 1 else float("inf"),
        p_value=p_value,
        seen_from=_seen_from(strength, weight, level),
        gain=float(likelihood[best]) - stated,
    )


def _seen_from(strength: Array, weight: Array, level: float) -> float:
    """The least factor that is told with probability :data:`TOLD`."""
    limit = _quantile(level, weight * (1.0 + strength))
    low, high = 0, FACTORS.size  # what is larger is told more often
    while low < high:
        middle = (low + high) // 2
        told = _above(limit, weight * (1.0 + FACTORS[middle] ** 2 * strength)) >= TOLD
        low, high = (low, middle) if told else (middle + 1, high)
    return float(FACTORS[low]) if low < FACTORS.size else float("inf")


def _above(value: float, weights: Array) -> float:
    """Probability that Σ weight·χ²₁ exceeds a value, by a χ² of three equal moments (Buckley and Eagleson 1988)."""
    mean, spread, dof = _moments(weights)
    if spread == 0.0:
        return 1.0
    return float(gammaincc(0.5 * dof, 0.5 * max((value - mean) / spread * np.sqrt(2.0 * dof) + dof, 0.0)))


def _quantile(level: float, weights: Array) -> float:
    mean, spread, dof = _moments(weights)
    return mean + spread * (2.0 * float(gammainccinv(0.5 * dof, level)) - dof) / np.sqrt(2.0 * dof) if spread else mean


def _moments(weights: Array) -> tuple[float, float, float]:
    """Mean, standard deviation, and the degrees of freedom with the same third moment."""
    mean, square, cube = (float(np.sum(weights**n)) for n in (1, 2, 3))
    return (mean, np.sqrt(2.0 * square), square**3 / cube**2) if cube > 0.0 else (mean, 0.0, 1.0)
