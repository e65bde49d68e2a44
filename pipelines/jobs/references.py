"""Whether a run's own residuals contradict what its station states of the table, and what they cannot show of it."""

import math
from typing import Annotated

from threadpoolctl import threadpool_limits
from typing_extensions import TypedDict

from inertial.errors import InertialError
from inertial.uncertainty.contradiction import LEVEL, Size
from inertial.uncertainty.rounding import equal
from pipelines.archive import Run
from pipelines.jobs.model_files import use_formulas_of
from pipelines.stages.uncertainty.budget_terms import BudgetTables, archived_terms
from pipelines.stages.uncertainty.contradiction import JUDGED, LotReferences, lot_references
from pipelines.stages.uncertainty.tables import LABELS
from schemas.errors import DataRejected, RecipeInvalid
from schemas.stated import TO_SI
from schemas.uncertainty import Uncertainty

READ = ("dwells", "history", "coefficients", "covariance", "wander", "verification", "verification_poses", "noise")
IMITATED = {"seat": "the misalignment of each unit", "gravity": "the scale factors"}
"""Entries that the coefficients of the units imitate wholly, and by what."""


class SeenReference(TypedDict):
    """A contribution of the table; all values are standard uncertainties in one unit."""

    entry: Annotated[str, "entry of [uncertainty]"]
    unit: Annotated[str, "of the values, that of the station's file"]
    stated: float
    found: Annotated[float, "likeliest value by the residuals"]
    low: Annotated[float, "of its 95 % interval"]
    high: Annotated[float | None, "of its 95 % interval; null: not bounded by the residuals"]
    told_from: Annotated[float | None, "value that is told with a probability of 90 %; null: none is"]
    worse: Annotated[bool, "larger than stated: told of about one honest lot in a hundred"]
    rivals: Annotated[list[str], "entries that explain the same residual as well"]


class ReferencesDocument(TypedDict):
    """The judgement of the stated errors of the table by the residuals that a run's units share."""

    worse: Annotated[bool | None, "whether the table is worse than stated; null: cannot be judged, see `reason`"]
    reason: Annotated[str | None, "why it cannot be judged"]
    p_value: Annotated[float | None, "probability of such a residual if the table is as stated"]
    along_p: Annotated[
        float | None,
        "the same along the force, where no error of the table acts: small where the model lacks an effect",
    ]
    seen: Annotated[list[SeenReference], "contributions that the run shows, those that are worse first"]
    not_seen: Annotated[list[str], "entries whose errors the coefficients imitate wholly"]


_judged: dict[tuple[str, ...], ReferencesDocument] = {}
"""The judgement of the last run: closing text, report and certificate of one command need it once."""


def references_of(run: Run) -> ReferencesDocument | None:
    """The judgement of a captured run; None where its station states no error of the table, or no table turned the units."""
    terms, tables = archived_terms(run.about), run.tables()
    poses = (run.about.get("recipe") or {}).get("poses")
    if terms is None or terms.stated is None or not (run.about.get("capture") and poses and {*READ} <= {*tables}):
        return None
    if not any(entry.standard().u > 0.0 for name, entry in terms.stated.entries.items() if name in JUDGED):
        return None
    key = (str(terms.document()), *(run.manifest(name)["sha256"] for name in READ))
    if key not in _judged:
        try:
            use_formulas_of(run)
            with threadpool_limits(1):
                found = lot_references(
                    BudgetTables(**{name: run.table(name) for name in READ}, lot=None, calibration=None), terms
                )
        except (DataRejected, RecipeInvalid, InertialError) as problem:
            found = str(problem).rstrip(".")
        _judged.clear()
        _judged[key] = _document(found, terms.stated)
    return _judged[key]


def _document(judged: LotReferences | str, stated: Uncertainty) -> ReferencesDocument:
    if isinstance(judged, str):
        return {"worse": None, "reason": judged, "p_value": None, "along_p": None, "seen": [], "not_seen": []}
    found = {size.name for size in judged.found}
    every = [*judged.found, *(size for size in judged.looked if size.name not in found)]
    told_from = {size.name: size.seen_from for size in (*judged.found, *judged.looked)}
    return {
        "worse": bool(found),
        "reason": None,
        "p_value": judged.p_value,
        "along_p": judged.along_p,
        "seen": [_seen(size, stated, told_from=told_from[size.name], worse=size.name in found) for size in every],
        "not_seen": [name for name in IMITATED if name in stated.entries and not stated.entries[name].exact],
    }


def _seen(size: Size, stated: Uncertainty, *, told_from: float, worse: bool) -> SeenReference:
    standard = stated.entries[size.name].standard()
    u = standard.u / TO_SI[standard.unit]
    return {
        "entry": size.name,
        "unit": standard.unit,
        "stated": u,
        "found": u * size.factor,
        "low": u * size.low,
        "high": _finite(u * size.high),
        "told_from": _finite(u * told_from),
        "worse": worse,
        "rivals": list(size.rivals),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


UNITS = {"urad": "µrad", "arcsec": "″", "deg": "°"}


def contradiction(judged: ReferencesDocument) -> str:
    """A sentence on stated and found errors where the table is worse than stated; else empty."""
    if not judged["worse"]:
        return ""
    parts = [_found(reference) for reference in judged["seen"] if reference["worse"]]
    text = f"the table is worse than stated (p {equal(judged['p_value'] or 0.0)}): {'; '.join(parts)}"
    if judged["along_p"] is not None and judged["along_p"] < LEVEL:
        text += (
            f"; or the model lacks an effect: the units have a common residual along the force too (p {equal(judged['along_p'])})"
            ", where no error of the table acts"
        )
    return text


def _found(reference: SeenReference) -> str:
    unit, high = UNITS.get(reference["unit"], reference["unit"]), reference["high"]
    interval = (
        f"above {_digits(reference['low'])}" if high is None else f"{_digits(reference['low'])} to {_digits(high)}"
    )
    names = " or ".join(LABELS[name] for name in (reference["entry"], *reference["rivals"]))
    stated, found = (_digits(reference[name]) for name in ("stated", "found"))
    return f"{names}: stated u {stated} {unit}, found {found} {unit} (95 %: {interval} {unit})"


def _digits(value: float, count: int = 3) -> str:
    """A value to so many digits, without an exponent up to a million."""
    return f"{float(f'{value:.{count}g}'):g}"


def unseen(judged: ReferencesDocument) -> str:
    """From which size on this run would show an error, and which errors it cannot show."""
    told = [
        f"{LABELS[reference['entry']]} {_from(reference)}"
        for reference in judged["seen"]
        if reference["told_from"] is not None
    ]
    none = [LABELS[reference["entry"]] for reference in judged["seen"] if reference["told_from"] is None]
    none += [f"{LABELS[name]} (acts as {IMITATED[name]})" for name in judged["not_seen"]]
    parts = [f"with 90 % probability this run would have shown: {', '.join(told)}"] if told else []
    parts += [f"it cannot show: {', '.join(none)}"] if none else []
    return "; ".join(parts) or "it shows nothing of the table"


def _from(reference: SeenReference) -> str:
    unit = UNITS.get(reference["unit"], reference["unit"])
    return f"if its u were {_digits(reference['told_from'] or 0.0, 2)} {unit} or more (stated: {_digits(reference['stated'])})"
