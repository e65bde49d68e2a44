"""Test of the effects added to a model: by a fresh run if there is one, else by dwells left out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from inertial.criticism.comparison import estimate, residuals_of, rms
from inertial.criticism.decisions import BLOCKS, LEFT_OUT, RISES
from inertial.criticism.left_out import left_out
from inertial.criticism.problem import Problem
from inertial.criticism.reproduced_change import reproduced_change
from pipelines.diagnosis.result_rows import known
from schemas.units import MICRO

if TYPE_CHECKING:
    from inertial.criticism.left_out import LeftOut
    from inertial.criticism.model import Model
    from inertial.criticism.problem import Lot


def progress(before: Model, after: Model, out: LeftOut, fresh: Lot | None) -> dict[str, Any]:
    """The evidence on the effects by which two models differ.

    Parameters
    ----------
    before, after : fitted to the same dwells; out : of ``after``, on dwells left out
    fresh : the fresh run in the scale of the first; None if there is none

    Returns
    -------
    ``judged_by``; ``confirmed``: true, false (evidence against it), or None (not decided); ``fall_ug`` with its standard error
    ``fall_u_ug``; on a fresh run ``part`` (λ) with ``part_u``; on dwells left out the gain in ``log_density``
    """
    if fresh is not None:
        return _by_fresh(before, after, out, fresh)
    return _by_left_out(left_out(before), out)


def _by_fresh(before: Model, after: Model, out: LeftOut, fresh: Lot) -> dict[str, Any]:
    old, new = estimate(before), estimate(after)
    change = reproduced_change(fresh, old, new)
    problem = Problem(fresh)
    rises = None
    if change.confirmed is True:
        unchanged = tuple(rms(residuals_of(problem, one)) for one in (old, new))
        rises = _rise("the error on the fresh run", *unchanged)
        rises = rises or _rise("the error on dwells left out", *_worst(before, out))
    return {
        "judged_by": "fresh run",
        "confirmed": None if rises else change.confirmed,
        "rises": rises,
        "part": known(change.part),
        "part_u": known(change.error),
        "fall_ug": MICRO * change.fall,
        "fall_u_ug": known(MICRO * change.fall_error),
        "estimated_again": change.again,
        "log_density": None,
    }


def _by_left_out(before: LeftOut, after: LeftOut) -> dict[str, Any]:
    kinds = set(before.density) & set(after.density)
    gains = {kind: after.density[kind] - before.density[kind] for kind in kinds}
    gain = gains.get("blocks of time")
    missed = [(before.missed[k], after.missed[k]) for k in sorted(kinds)]
    falls = [float(np.sqrt(np.nanmean(a**2)) - np.sqrt(np.nanmean(b**2))) for a, b in missed]
    worst = int(np.argmin(falls)) if falls else 0
    both = (before.rms(kinds), after.rms(kinds)) if kinds else (float("nan"), float("nan"))
    convincing = gain is not None and gain > LEFT_OUT
    rises = _rise("the error on dwells left out", *both) if convincing else None
    return {
        "judged_by": "dwells left out",
        # absence of evidence is no evidence: without a fresh run nothing is refuted
        "confirmed": True if convincing and not rises else None,
        "rises": rises,
        "part": None,
        "part_u": None,
        "fall_ug": MICRO * falls[worst] if falls else None,
        "fall_u_ug": known(MICRO * _error(*missed[worst])) if falls else None,
        "estimated_again": None,
        "log_density": gain,
    }


def _rise(what: str, before: float, after: float) -> str | None:
    """The error that rises with the added effects, as text; None if none rises or none can be judged."""
    if not (np.isfinite(before) and np.isfinite(after)):
        return None
    if after <= (1.0 + RISES) * before:
        return None
    return f"{what} rises from {MICRO * before:.3g} to {MICRO * after:.3g} µg"


def _worst(before: Model, after: LeftOut) -> tuple[float, float]:
    """The worst error on dwells left out before and after, over the kinds that can judge both."""
    first = left_out(before)
    kinds = set(first.density) & set(after.density)
    return first.rms(kinds), after.rms(kinds)


def _error(before: np.ndarray, after: np.ndarray) -> float:
    """Standard error of the decrease of the RMS, by leaving out stretches of time in turn."""
    n = before.shape[1]
    stretch = np.arange(n) * min(BLOCKS, n) // n
    falls = []
    for k in range(int(stretch.max()) + 1):
        rest = stretch != k
        one, other = (np.sqrt(np.nanmean(v[:, rest] ** 2)) for v in (before, after))
        falls.append(one - other)
    count = len(falls)
    return float(np.sqrt((count - 1) / count * np.sum((np.array(falls) - np.mean(falls)) ** 2)))
