"""Test of effects added to a model, by a fresh run or else by dwells left out; and the errors of all versions of a model."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from inertial.arrays import Array
from inertial.criticism.left_out import Kind, LeftOut, left_out
from inertial.criticism.reproduced_change import reproduced_change, without_own_bias
from inertial.decisions import BLOCKS, CONFIRMED, LEFT_OUT, RISES
from inertial.estimation.comparison import estimate, residuals_of, rms
from inertial.estimation.model import Model
from inertial.estimation.problem import Lot, Problem
from inertial.uncertainty.rounding import short
from pipelines.diagnosis.documents import ComparisonDocument, Confirmation, VersionDocument
from pipelines.diagnosis.result_rows import known
from pipelines.jobs.model_files import Version
from schemas.units import MICRO

_WORDED_KINDS = {"blocks of time": "stretches of time"}
"""Names of kinds of dwells left out in texts, where they differ from the keys."""


def progress(
    before: Model, after: Model, out: LeftOut, fresh: Lot | None, doubt: Callable[[], str | None] = lambda: None
) -> Confirmation:
    """The evidence for or against the effects by which two models differ.

    Parameters
    ----------
    before, after : models fitted to the same dwells; out : cross-validation of ``after``
    fresh : the fresh run in units of the first run's scale factors; None if there is none
    doubt : function that gives a reason why a fault of the run may imitate the effects, see
        :func:`pipelines.diagnosis.compare.doubt_of_run`; called only without a fresh run, if dwells left out favour the effects

    Returns
    -------
    ``judged_by``; ``confirmed``: true, false (evidence against it), or None (not decided, for the ``reason``); ``fall_ug`` with
    its standard error ``fall_u_ug``; on a fresh run ``part`` (λ) with ``part_u``; on dwells left out the gain in ``log_density``
    """
    if fresh is not None:
        return _by_fresh(before, after, out, fresh)
    return _by_left_out(left_out(before, also=after.terms), out, doubt)


def _by_fresh(before: Model, after: Model, out: LeftOut, fresh: Lot) -> Confirmation:
    old, new = estimate(before), estimate(after)
    change = reproduced_change(fresh, old, new)
    problem = Problem(fresh)
    rises, reason = None, None
    if change.confirmed is True:
        # residuals with unchanged coefficients, less the bias of the fresh run
        left = [without_own_bias(problem, fitted.terms, residuals_of(problem, fitted)) for fitted in (old, new)]
        rises = _clear_rise("the error on the fresh run", left[0], left[1]) or _rises_left_out(
            left_out(before, also=after.terms), out
        )
        reason = rises
        if not rises and np.isfinite(change.fall_error) and not change.fall > CONFIRMED * change.fall_error:
            reason = "the fall of the error is not clearly more than its uncertainty"
    elif change.confirmed is None:
        reason = "the fresh run does not decide; measure another run"
    return {
        "judged_by": "fresh run",
        "confirmed": None if reason else change.confirmed,
        "rises": rises,
        "reason": reason,
        "part": known(change.part),
        "part_u": known(change.error),
        "fall_ug": MICRO * change.fall,
        "fall_u_ug": known(MICRO * change.fall_error),
        "estimated_again": change.again,
        "log_density": None,
    }


def _by_left_out(before: LeftOut, after: LeftOut, doubt: Callable[[], str | None] = lambda: None) -> Confirmation:
    kinds: list[Kind] = [kind for kind in before.density if kind in after.density]
    gains: dict[Kind, float] = {kind: after.density[kind] - before.density[kind] for kind in kinds}
    gain = gains.get("blocks of time")
    falls: dict[Kind, tuple[float, float]] = {kind: _fall(before.missed[kind], after.missed[kind]) for kind in kinds}
    worst = min(kinds, key=lambda kind: falls[kind][0]) if kinds else None
    errors = (before.rms(set(kinds)), after.rms(set(kinds))) if kinds else (float("nan"), float("nan"))
    rises = None
    if gain is None:
        against = "no judgement is possible"
    elif not gain > LEFT_OUT:  # a nan is no gain
        against = f"their log likelihood changes by {gain:+.1f}, more than {LEFT_OUT:g} is needed"
    else:
        rises = _rise("the error on dwells left out", *errors)
        # the search for a fault of the run takes longest and is made only if it decides
        against = rises or _disagreement(gains, falls) or doubt()
    return {
        "judged_by": "dwells left out",
        # absence of evidence is not evidence of absence: without a fresh run nothing is refuted
        "confirmed": None if against else True,
        "rises": rises,
        "reason": against,
        "part": None,
        "part_u": None,
        "fall_ug": MICRO * falls[worst][0] if worst else None,
        "fall_u_ug": known(MICRO * falls[worst][1]) if worst else None,
        "estimated_again": None,
        "log_density": gain,
    }


def _disagreement(gains: Mapping[Kind, float], falls: Mapping[Kind, tuple[float, float]]) -> str | None:
    """A kind of dwells left out that can judge the effects and is not clearly for them, as text; None if there is none."""
    for kind, gain in sorted(gains.items(), key=lambda item: falls[item[0]][0]):
        fall, error = falls[kind]
        left = f"with {_WORDED_KINDS.get(kind, kind)} left out"
        # an error that cannot be stated is none that the fall exceeds
        if not fall > CONFIRMED * error:
            return f"{left} {fall_of(MICRO * fall, known(MICRO * error))}, no clear fall"
        if gain <= LEFT_OUT:
            return f"{left} the log likelihood changes by {gain:+.1f}, more than {LEFT_OUT:g} is needed"
    return None


def fall_of(fall: float, error: float | None) -> str:
    """The decrease of an error, µg, with its standard uncertainty, as text."""
    from pipelines.procedures.figures import with_uncertainty  # its room loads every procedure

    size = f"{float(f'{abs(fall):.3g}'):g}" if error is None else f"{with_uncertainty(abs(fall), 2.0 * error)} (k = 2)"
    return f"the error {'falls' if fall >= 0.0 else 'rises'} by {size} µg"


def _rise(what: str, before: float, after: float) -> str | None:
    """The error that rises with the added effects, as text; None if none rises or none can be judged."""
    if not (np.isfinite(before) and np.isfinite(after)) or after <= (1.0 + RISES) * before:
        return None
    return f"{what} rises from {short(MICRO * before)} to {short(MICRO * after)} µg"


def _rises_left_out(first: LeftOut, after: LeftOut) -> str | None:
    """A kind of dwells left out of the first run that speaks against the effects, as text; None if there is none.

    Its error rises by more than its uncertainty, or it rises and the log density falls by as much as would confirm.
    """
    what = "the error on dwells left out"
    kinds: list[Kind] = [kind for kind in first.density if kind in after.density]
    for kind in kinds:
        old, new = first.missed[kind], after.missed[kind]
        against = after.density[kind] - first.density[kind] < -LEFT_OUT
        text = _rise(what, rms(old), rms(new)) if against else _clear_rise(what, old, new)
        if text:
            return text
    return None


def _clear_rise(what: str, before: Array, after: Array) -> str | None:
    """The error of residuals (blocks, n), g, that rises by more than its uncertainty, as text; None if it does not.

    A fresh run decides by itself: what changes by chance on other dwells is no evidence against an effect.
    """
    fall, error = _fall(before, after)
    return _rise(what, rms(before), rms(after)) if not fall >= -CONFIRMED * error else None


def _fall(before: Array, after: Array) -> tuple[float, float]:
    """Decrease of the RMS of dwells left out, g, and its standard error, by leaving out stretches of time in turn."""
    n = before.shape[1]
    stretch = np.arange(n) * min(BLOCKS, n) // n
    falls = [_decrease(before[:, stretch != k], after[:, stretch != k]) for k in range(int(stretch.max()) + 1)]
    count = len(falls)
    error = float(np.sqrt((count - 1) / count * np.sum((np.array(falls) - np.mean(falls)) ** 2)))
    return _decrease(before, after), error


def _decrease(before: Array, after: Array) -> float:
    return float(np.sqrt(np.nanmean(before**2)) - np.sqrt(np.nanmean(after**2)))


Compare = Callable[[list[str], list[str] | None], ComparisonDocument]
"""Function of a model's effects and those of the model before, with the result of :func:`pipelines.diagnosis.compare.compare`."""


def evolution(versions: Sequence[Version], compare: Compare) -> list[VersionDocument]:
    """One row per version: the change, its errors, and the verdict on the change as text.

    Parameters
    ----------
    versions : oldest first
    """
    rows: list[VersionDocument] = []
    before: list[str] | None = None
    for version in versions:
        row, effects = change_row(version), list(version.effects)
        errors = compare(effects, before if version.added else None)
        row["fitted_ug"], row["heldout_ug"] = errors["rms_ug"], errors["heldout_rms_ug"]
        row["fresh_ug"], row["floor_ug"] = errors["fresh_rms_ug"], errors["floor_ug"]
        progress = errors["progress"]
        if progress is not None:
            row["fall_ug"], row["fall_u_ug"] = progress["fall_ug"], progress["fall_u_ug"]
            row["confirmed"], row["reason"] = progress["confirmed"], progress["reason"]
        row["text"] = text_of(row, progress) if before is not None else "the model to begin with"
        row["warnings"] = errors["warnings"]
        rows.append(row)
        before = effects
    return rows


def change_row(version: Version) -> VersionDocument:
    """The row of a version with its change, author, date and reason; its errors are empty."""
    change = version.change
    return {
        "version": version.number,
        "added": list(version.added),
        "removed": list(version.removed),
        "effects": list(version.effects),
        "by": change.by if change else "",
        "at": change.at.isoformat() if change else "",
        "why": change.why if change else "",
        "run": change.run if change else "",
        "fitted_ug": None,
        "heldout_ug": None,
        "fresh_ug": None,
        "floor_ug": None,
        "fall_ug": None,
        "fall_u_ug": None,
        "confirmed": None,
        "reason": None,
        "text": "",
        "warnings": [],
    }


def text_of(row: VersionDocument, progress: Confirmation | None) -> str:
    """The verdict of unfitted data on a change, as text."""
    if progress is None:
        return "removed" if row["removed"] else "nothing added"
    fall = _fall_text(progress)
    if progress["judged_by"] == "fresh run":
        return _text_by_fresh(progress, fall)
    gain, size = progress["log_density"], progress["fall_ug"]
    least = "falls least" if size is None or size >= 0.0 else "rises most"
    where = "" if size is None else f" where it {least} of the poses, soaks and stretches of time left out"
    if progress["confirmed"]:
        return f"confirmed on stretches of time left out (log likelihood +{gain:.1f}), and the run shows no fault; {fall}{where}"
    why = progress["reason"] or "no judgement is possible"
    text = why if fall in why else f"{why}; {fall}{where}"
    decides = "a fresh run of the same units decides"
    if gain is not None and gain > LEFT_OUT:
        return (
            f"not decided by this run alone: stretches of time left out confirm it (log likelihood "
            f"+{gain:.1f}), but {text}; {decides}"
        )
    return f"not decided by dwells left out: {text}; {decides}"


def _text_by_fresh(progress: Confirmation, fall: str) -> str:
    part, error = progress["part"], progress["part_u"]
    if part is None or error is None:
        return "not decided: the dwells of the fresh run do not show the effect; measure the same poses and temperatures again"
    came = f"{part:.2f} ± {2.0 * error:.2f} (k = 2) of the predicted change appears in the fresh run"
    if progress["confirmed"] is True:
        return f"confirmed: {came}; {fall}"
    if progress["confirmed"] is False:
        return f"refuted: {came}; {fall}"
    if part > CONFIRMED * error:  # the part alone would confirm it
        return f"not decided: {came}, but {progress['reason']}; {fall}; measure another run"
    return f"not decided: {came}; {fall}; measure another run"


def _fall_text(progress: Confirmation) -> str:
    """The decrease of the error with its uncertainty; for a fresh run with the coefficients that were fitted to it again."""
    fall = progress["fall_ug"]
    if fall is None:
        return "the error cannot be judged on dwells left out"
    beside = {"base": "the coefficients of the earlier model", "bias": "the bias of each unit"}
    refitted = beside.get(progress["estimated_again"] or "")
    return fall_of(fall, progress["fall_u_ug"]) + (f" with {refitted} fitted to the fresh run anew" if refitted else "")
