"""``[prior]`` of a recipe: earlier calibrations whose family is a prior of the coefficients, and the family as a run keeps it."""

from datetime import date
from typing import ClassVar

from schemas.bounds import Text
from schemas.strict import Grown, Strict


class PriorTerms(Grown):
    """Where a prior comes from.

    archive : address of the archive with the earlier calibrations; empty: that of the run
    since : first day of their runs
    full : recipe with the full plan, which a lot goes on with where it, or one of its units, does not fit the family
    attribute : of the units, such as ``wafer``: a unit leans on earlier units with the same value; empty: on the family alone
    """

    later: ClassVar[frozenset[str]] = frozenset({"archive", "since", "full", "attribute"})

    archive: Text = ""
    since: date | None = None
    full: Text = ""
    attribute: Text = ""


class StoredOwn(Strict):
    """What a unit's own earlier calibrations say of it: mean (m, p) and covariance (m, p, p)."""

    mean: list[list[float]]
    covariance: list[list[list[float]]]


class StoredFamily(Strict):
    """A family (:class:`inertial.population.family.Family`) with what it was made from: what a re-run reads.

    effects : of the p columns; runs : whose calibrations it is made of; the others as in the family
    groups : by serial number, what a unit has its prior from in place of earlier calibrations of its own, such as ``wafer W07``
    """

    effects: list[str]
    runs: list[str]
    mean: list[list[float]]
    unit: list[list[list[float]]]
    lot: list[list[list[float]]]
    error: list[list[list[float]]]
    units: int
    lots: int
    tails: list[list[float]]
    own: dict[str, StoredOwn] = {}
    groups: dict[str, str] = {}
