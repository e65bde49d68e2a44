"""Results of a diagnosis as rows of its document: classes, dwells of largest influence, dwells left out."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from inertial import effects as catalogue
from inertial.criticism.diagnosis import Diagnosis, Named
from inertial.criticism.examination import ExaminedRun
from inertial.criticism.influence import CarriedEvidence
from inertial.data_errors.removed_dwells import BadDwell
from inertial.decisions import NAMED_BELOW
from inertial.estimation.comparison import fitted_residuals, rms
from inertial.estimation.likelihood import correlation_of_units
from inertial.estimation.model import Model
from inertial.estimation.refinement import intervals, settled, terms_of
from inertial.uncertainty.rounding import short
from pipelines.diagnosis.documents import (
    EffectClassDocument,
    InfluentialDwell,
    LeaveOut,
    NamedDwell,
    NoiseFigures,
    RemovedDwells,
    SmallestNamed,
    StudentisedDwell,
    SuspectedEffects,
    UnseenInPart,
    VerdictEvidence,
    WithoutInfluence,
)
from pipelines.tables.sound_lot import probability
from schemas.units import MICRO

BAD_DWELL = "bad_dwell"
"""Id of a fault of a single dwell of one unit."""

_ALIKE = 0.5
"""Share of the residual variance common to all units from which on a notice is given."""

_LESS = 3.0
"""Noise of a dwell by its samples over that by the scatter of dwells, from which on a notice is given."""

_ACROSS, _ALONG = 0.3, 0.9
"""Forces along the axis, g, below and above which the noise of its dwells is averaged for comparison."""


@dataclass(frozen=True)
class Names:
    """Serial numbers and numbers of dwells, in the order of a diagnosis' arrays."""

    units: tuple[str, ...]
    dwells: tuple[int, ...]

    def at(self, unit: int, dwell: int) -> NamedDwell:
        """A dwell of a unit by its names."""
        return {"unit": self.units[unit], "dwell": self.dwells[dwell]}


def known(value: float) -> float | None:
    """A number; None if it is not finite."""
    return float(value) if np.isfinite(value) else None


def classes_of(diagnosis: Diagnosis, names: Names) -> list[EffectClassDocument]:
    """Rows of all classes: handling errors first, because they must be corrected before effects are judged."""
    rows = [_class(n, names) for n in diagnosis.handled]
    rows += [_bad_dwell(diagnosis, d, names) for d in diagnosis.removed if not d.tail]
    fitted = _fitted_parameters(diagnosis)
    for named in diagnosis.named:
        row = _class(named, names)
        if (found := fitted.get(named.effects.proposed.effect.id)) is not None:
            row["nonlinear"], row["nonlinear_interval"] = found
        rows.append(row)
    return rows


def _fitted_parameters(diagnosis: Diagnosis) -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    """Nonlinear parameters and intervals of the named effects, as ``compare`` gives them for the model with all of these.

    The values of the search differ, because it estimates them at another noise and beside other terms.
    """
    added = [n.effects.proposed for n in diagnosis.named if not n.effects.of_data]
    if not any(term.values for term in added):
        return {}
    known = catalogue.catalogue()
    judged = [t.effect.id for t in diagnosis.base.terms if t.effect.id in known or ":" in t.effect.id]
    problem = diagnosis.problem  # reuses its stored columns and whiteners
    ids = dict.fromkeys([*judged, *(term.effect.id for term in added)])
    model = settled(Model(problem, terms_of(catalogue.get_all(list(ids)), problem)))
    between = intervals(model)
    return {
        term.effect.id: (dict(term.values), dict(between.get(term.effect.id, {})))
        for term in model.terms
        if term.values and term.effect.id in {proposed.effect.id for proposed in added}
    }


def _class(named: Named, names: Names) -> EffectClassDocument:
    group = named.effects
    proposed, scope = group.proposed, group.scope
    low, high = proposed.effect.typical_ug
    row: EffectClassDocument = {
        "effects": list(group.ids),
        "scope": scope,
        "rms_after_ug": MICRO * named.rms_after,
        "heldout_after_ug": known(MICRO * named.heldout_after),
        "heldout_before_ug": known(MICRO * named.heldout_before),
        "p_value": probability(group.log_p),
        "size_ug": MICRO * group.size,
        "nonlinear": {} if scope == "data" else dict(proposed.values),
        "nonlinear_of": None if scope == "data" or not proposed.values else proposed.effect.id,
        "plausible": group.size <= 0.0 or 0.1 * low <= MICRO * group.size <= high,  # within the noise it is not judged
        "influence": _dwells(named.carried, names),
        "without_influence": without_influence(named.carried),
    }
    if named.evidence:
        units = [names.units[u] for u in named.units]
        row["units"], row["dwells"] = units, [names.dwells[d] for d in named.dwells]
        row["evidence"] = f"{' and '.join(units)}: {named.evidence}" if len(units) > 1 else named.evidence
    return row


def _bad_dwell(diagnosis: Diagnosis, bad: BadDwell, names: Names) -> EffectClassDocument:
    size = float(np.linalg.norm(bad.off))
    return {
        "effects": [BAD_DWELL],
        "scope": "data",
        "rms_after_ug": MICRO * diagnosis.rms,
        "heldout_after_ug": None,
        "p_value": probability(-0.5 * bad.deviations**2),
        "size_ug": MICRO * size,
        "nonlinear": {},
        "plausible": True,
        "units": [names.units[bad.unit]],
        "dwells": [names.dwells[bad.dwell]],
        "influence": [{**names.at(bad.unit, bad.dwell), "share": 1.0}],
        "without_influence": {"dwells": 1, "p_value": 1.0},
        "evidence": f"{MICRO * size:.0f} µg off, {bad.deviations:.1f} standard deviations; the dwell is left out",
    }


def in_part_of(diagnosis: Diagnosis) -> list[UnseenInPart]:
    """Effects that the plan cannot show at some values of their nonlinear parameters, one row per range."""
    return [
        {
            "effect": name,
            "parameter": r.parameter,
            "unit": r.unit,
            "from": r.low,
            "to": r.high,
            "text": str(r),
            "breaker": catalogue.get(name).breaker,
        }
        for name, ranges in diagnosis.unseen_in_part
        for r in ranges
    ]


def smallest_of(diagnosis: Diagnosis) -> list[SmallestNamed]:
    """Smallest detectable sizes of effects, effects hidden most by slow noise first."""
    return [
        {"effect": s.effect, "size_ug": MICRO * s.size, "without_slow_noise_ug": MICRO * s.without_slow}
        for s in diagnosis.smallest
    ]


def evidence_of(diagnosis: Diagnosis, names: Names) -> VerdictEvidence:
    """The basis of the verdict: degrees of freedom, condition number, jackknife of the bias, smallest detectable cubic term."""
    evidence = diagnosis.evidence
    largest: StudentisedDwell | None = None
    if evidence.largest is not None:
        size, unit, dwell = evidence.largest
        largest = {**names.at(unit, dwell), "studentised": known(round(size, 2))}
    return {
        "degrees_of_freedom": evidence.dof,
        "condition": known(evidence.condition),
        "bias_jackknife_ug": _micro(evidence.bias_spread),
        "bias_change_ug": _micro(evidence.bias_change),
        "bias_change_by": None if evidence.carrier is None else names.at(*evidence.carrier),
        "largest_residual": largest,
        "smallest_cubic_ug": _micro(evidence.cubic),
    }


def _micro(value: float | None) -> float | None:
    return None if value is None else known(MICRO * value)


def white_noise_of(model: Model) -> float | None:
    """RMS of the white noise of the dwell means from their samples, sd/√n, µg; None if not recorded."""
    error = model.problem.error
    finite = error[np.isfinite(error)]
    lot = model.problem.lot
    if not finite.size or (lot.radial and not lot.recorded):
        return None
    return known(MICRO * float(np.sqrt(np.mean(finite**2))))


def leave_out_of(diagnosis: Diagnosis, names: Names) -> LeaveOut | None:
    """The single dwells to leave out, and the verdict on the others; None if there are none."""
    dwells = [d for d in diagnosis.removed if not d.tail]
    if not dwells:
        return None
    return {
        "dwells": [names.at(d.unit, d.dwell) for d in dwells],
        "adequate_without": diagnosis.without_removed,
    }


def influence_of(diagnosis: Diagnosis, names: Names) -> list[InfluentialDwell]:
    """Dwells by influence on the verdict, largest first; a dwell left out as bad has a share of 1."""
    single = [d for d in diagnosis.removed if not d.tail]
    rows: list[InfluentialDwell] = [{**names.at(d.unit, d.dwell), "share": 1.0} for d in single]
    if rows and not (diagnosis.named or diagnosis.handled):
        return rows
    return _dwells(diagnosis.carried, names)


def _dwells(carried: CarriedEvidence, names: Names) -> list[InfluentialDwell]:
    return [{**names.at(d.unit, d.dwell), "share": round(d.share, 4)} for d in carried.dwells]


def without_influence(carried: CarriedEvidence) -> WithoutInfluence | None:
    """The verdict without the dwells of largest influence; None if nothing is named."""
    if carried.log_p_without is None:
        return None
    return {"dwells": len(carried.dwells), "p_value": probability(carried.log_p_without)}


def removed_of(diagnosis: Diagnosis, names: Names) -> RemovedDwells | None:
    """Single dwells that were left out, and whether they are tails of the noise; None if there are none."""
    if not diagnosis.removed:
        return None
    return {
        "heavy_tails": any(d.tail for d in diagnosis.removed),
        "dwells": [
            {
                **names.at(d.unit, d.dwell),
                "off_ug": MICRO * float(np.linalg.norm(d.off)),
                "deviations": round(d.deviations, 2),
                "tail": d.tail,
            }
            for d in diagnosis.removed
        ],
    }


def noise_of(model: Model) -> NoiseFigures:
    """The estimated noise: shares of 1/f noise and random walk, and the ratio of the largest to the smallest scale of a block."""
    noise = model.noise
    return {
        "wander_share": float(noise.shares.flicker),
        "walk_share": float(noise.shares.walk),
        "noise_spread": float(np.max(noise.scale) / np.min(noise.scale)),
    }


def noise_along(run: ExaminedRun) -> list[str]:
    """A notice with the ratio, if the white noise depends on the force along the axis; else empty."""
    if run.louder is None:
        return []
    force = np.broadcast_to(run.lot.state.force, (*run.louder.shape[:2], 3))[..., list(run.lot.state.axes)]
    across, along = (run.louder[part] for part in (np.abs(force) < _ACROSS, np.abs(force) > _ALONG))
    if not (across.size and along.size):
        return []
    ratio = float(np.sqrt(np.mean(along**2) / np.mean(across**2)))
    along_gravity = ratio > 1.0
    larger, smaller = ("along", "across") if along_gravity else ("across", "along")
    cause = (
        "the reference voltage and vibration of the floor" if along_gravity else "how well the table repeats its angles"
    )
    times = max(ratio, 1.0 / max(ratio, 1e-9))
    text = (
        f"the white noise of a dwell is {times:.2g} times as large where the axis lies {larger} gravity as {smaller} it"
    )
    return [f"{text}; the dwells are weighted by it; check {cause}"]


def less_than_samples(model: Model) -> list[str]:
    """A notice if the dwells scatter far less than the stated samples let expect; else empty."""
    error, found = model.problem.lot.error, model.floor()
    stated = rms(error[np.isfinite(error)])
    if not model.problem.lot.recorded or stated < _LESS * found:
        return []
    text = f"by sd and n the noise of a dwell is {short(MICRO * stated)} µg, and the dwells scatter by {short(MICRO * found)} µg"
    return [f"{text} only: check the unit of sd, unless a vibration averages out in the means"]


def noise_of_the_lot(model: Model, units: int) -> list[str]:
    """A notice if most of the residual variance is common to all units; else empty."""
    common = correlation_of_units(model)
    if common < _ALIKE:
        return []
    shared, single = (short(MICRO * rms(fitted_residuals(model)) * part**0.5) for part in (common, 1.0 - common))
    text = f"{shared} µg of the residual are common to all {units} units, {single} µg differ between them"
    return [f"{text}: look for a cause that they share, such as table, fixture, reference or supply"]


def suspected_of(diagnosis: Diagnosis) -> SuspectedEffects | None:
    """The most probable missing effects of a model that fails without a named cause; None if there are none."""
    suspected = diagnosis.suspected
    if suspected is None:
        return None
    return {
        "effects": list(suspected.effects),
        "p_value": probability(suspected.log_p),
        "named_below": NAMED_BELOW,
        "rms_after_ug": MICRO * suspected.rms_after,
        "breaker": catalogue.get(suspected.effects[0]).breaker,
    }
