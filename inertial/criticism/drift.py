"""Sudden changes that are the pieces of one drift: a smooth curve of one driver is better than all of them together."""

from collections.abc import Sequence
from dataclasses import dataclass

from inertial.criticism.drivers import Part
from inertial.criticism.lot_part import LotPart
from inertial.criticism.unknown import better_curve, log_p_of_curve
from inertial.estimation.model import Model
from inertial.estimation.term import Term

_TOGETHER = 2  # smallest number of changes and effects that may be one drift


@dataclass(frozen=True)
class Drift:
    """A drift that the search had taken for sudden changes.

    driver : the recorded quantity that it follows; part : what of the output follows it
    log_p : natural logarithm of the probability that noise follows it as much
    floor : noise of the measurement with the drift in the model, g
    imitated : ids of the changes that only imitated it
    """

    driver: str
    part: Part
    log_p: float
    floor: float
    imitated: frozenset[str]


def one_drift(part: LotPart, changes: Sequence[Term], further: Sequence[Term]) -> Drift | None:
    """The drift that sudden changes, with what was found beside them, are pieces of; None if they are not.

    One step of the reader's reference is an event. Two of them, one after the other, are what a scale factor that changes slowly
    looks like; a fixture that moved, and misalignments that follow the temperature, are what a fixture that bends looks like. A
    single change is never doubted: known causes have priority.

    Parameters
    ----------
    changes : terms of the judged model that are changes of handling
    further : effects or changes beyond that model
    """
    known = {t.key for t in changes}
    held = [t for t in part.base.terms if t.key in known]
    if not held or len(held) + len(further) < _TOGETHER:
        return None
    rest = [t for t in part.base.terms if t.key not in known]
    base = Model(part.field.problem, rest, near=part.base.noise)
    instead = better_curve(base, [*held, *further], part.every_suspect)
    if instead is None:
        return None
    fit, kept = instead
    remaining = {t.key for t in kept}
    imitated = frozenset(t.effect.id for t in held if t.key not in remaining)
    if not imitated:
        return None
    log_p = log_p_of_curve(base, fit, len(part.every_suspect))
    return Drift(fit.driver, fit.part, log_p, fit.model.floor(), imitated)
