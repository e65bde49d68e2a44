"""A diagnosis in sentences: the verdict with its numbers, its basis, the dwells that decide it, the next measurement."""

import re
from collections.abc import Mapping
from typing import Any

from inertial.counts import degrees_of_freedom, number_of
from inertial.criticism.evidence import FEW_DOF
from inertial.decisions import ADEQUATE_ABOVE
from inertial.uncertainty.rounding import chance, equal, short
from pipelines.diagnosis.documents import DiagnosisDocument, EffectClassDocument, NextMeasurement, SmallestNamed
from pipelines.tables.sound_lot import SMALL_MISFIT, is_small

BAD_DWELL = "bad_dwell"
_NOT_RECORDED = re.compile(r"the dwells carry no (\w+):")
HIDDEN, SHOWN = 3.0, 4
"""Factor by which slow noise must raise the smallest detectable size of an effect to list it, and the number of effects
listed."""
NAMED_DWELLS = 5
"""Number of dwells named in a sentence."""

UNSEEN = "not seen so far: "
"""Beginning of the purpose of steps that show effects which the plan so far cannot show."""

UNEXPLAINED = "Significant, but of unknown cause"


def verdict(document: DiagnosisDocument) -> str:
    """The verdict in one sentence with its numbers."""
    error, faulty = document["error"], {u for f in document["blocked_by"] for u in f["units"]}
    judged = {"adequate": document["adequate"], "reason": document.get("reason"), **error}
    judged["units"] = len(document["units"]) - len(faulty)
    text = plain_verdict(judged)
    if document["adequate"] is not False:
        return f"{text}."
    spoilt = [class_text(group) for group in document["classes"] if group["scope"] == "data"]
    single = document["leave_out"]
    named = [" or ".join(group["effects"]) for group in document["classes"] if group["scope"] != "data"]
    if spoilt:
        rest = f"; also missing: {', and '.join(named)}" if named else ""
        passes = not named and not document["unexplained"] and (error["p_value"] or 0.0) >= ADEQUATE_ABOVE
        unknown = single is not None and single["adequate_without"] is None
        found = "is adequate" if passes else "is not adequate either"
        without = f"the model {'cannot be judged' if passes and unknown else found}: {_figures(judged)}"
        return f"NOT ADEQUATE: the run has faults of the data: {'; '.join(spoilt)}; without them {without}{rest}."
    if named:
        return f"{text}; missing: {', and '.join(named)}."
    plain = "no effect and no recorded quantity explains the residual: its cause is not recorded, or its noise is not understood"
    rest = document["reason"] or suspected_text(document) or plain
    if document["unexplained"]:
        rest = f"{document['unexplained']['text']}, and no effect of the catalogue explains it"
    return f"{text}; {rest}."


def plain_verdict(judged: Mapping[str, Any]) -> str:
    """The verdict with residual, noise and probability, without a full stop.

    Parameters
    ----------
    judged : ``adequate``, ``reason``, ``rms_ug``, ``floor_ug``, ``p_value`` and ``units``, the number of units that were judged
    """
    if judged["adequate"] is None:
        return f"CANNOT BE JUDGED: {judged['reason']}"
    if judged["adequate"]:
        return f"ADEQUATE: {_figures(judged)}"
    small = f"; {SMALL_MISFIT}" if is_small(judged) else ""
    return f"NOT ADEQUATE: {_figures(judged)}{small}"


def _figures(judged: Mapping[str, Any]) -> str:
    units = judged["units"]
    left = f"residual {short(judged['rms_ug'])} µg rms over {number_of(units, 'unit')}"
    return f"{left}; noise of the measurement {short(judged['floor_ug'])} µg rms (p {equal(judged['p_value'])})"


def class_text(group: EffectClassDocument) -> str:
    """A handling error with its unit and first dwell, and the effects that explain the data equally well."""
    units, dwells = group.get("units") or [], group.get("dwells") or []
    where = f"{', '.join(units) or 'all units'}{f', dwell {dwells[0]}' if dwells else ''}"
    return f"{' or '.join(group['effects'])} ({where})"


def cards(document: DiagnosisDocument) -> list[tuple[str, str]]:
    """The figures of a verdict, each with its meaning; none where every unit has a data fault."""
    error, classes = document["error"], document["classes"]
    if error["rms_ug"] is None:
        return []
    figures = [
        (f"{short(error['rms_ug'])} µg", "residual of the model, rms"),
        (f"{short(error['floor_ug'])} µg", "noise of the measurement, rms: with the missing effects in the model"),
    ]
    if classes:
        figures.append((f"{short(classes[-1]['rms_after_ug'])} µg", "rms after the effects are added"))
    return [*figures, (chance(error["p_value"]), "probability of the residual under noise alone")]


def evidence_text(document: DiagnosisDocument) -> str:
    """The basis of the verdict in one line; empty without a verdict."""
    evidence = document.get("evidence")
    if not evidence:
        return ""
    parts = [degrees_of_freedom(evidence["degrees_of_freedom"])]
    if evidence["condition"] is not None:
        parts.append(f"condition {short(evidence['condition'])}")
    if evidence["bias_jackknife_ug"] is not None and evidence["bias_change_by"] is not None:
        by = evidence["bias_change_by"]
        parts.append(
            f"bias ± {short(evidence['bias_jackknife_ug'])} µg by leaving out single dwells (most by dwell {by['dwell']} "
            f"of {by['unit']}: {short(evidence['bias_change_ug'])} µg)"
        )
    return "; ".join(parts)


def few_dwells(document: DiagnosisDocument) -> bool:
    """Whether an adequate model was judged by so few dwells that the smallest detectable effect must be stated."""
    evidence = document.get("evidence")
    return bool(document["adequate"] and evidence and evidence["degrees_of_freedom"] < FEW_DOF)


def undetected(document: DiagnosisDocument) -> str:
    """The smallest cubic term that the dwells detect; empty without a verdict."""
    evidence = document.get("evidence")
    if not evidence:
        return ""
    smallest = evidence["smallest_cubic_ug"]
    if smallest is None and "third_order" in document.get("effects", ()):
        return "few dwells" if few_dwells(document) else ""  # the model has a cubic term: none is missing
    few = "few dwells: " if few_dwells(document) else ""
    size = f"is detected from {short(smallest)} µg/g³ on, with a probability of one half"
    return f"{few}a cubic term {'of any size is not detected' if smallest is None else size}"


def hidden(document: DiagnosisDocument) -> list[SmallestNamed]:
    """The effects whose smallest detectable size slow noise (1/f, random walk) raises most."""
    named = document.get("smallest_named", ())
    return [row for row in named if row["size_ug"] > HIDDEN * row["without_slow_noise_ug"]][:SHOWN]


def slow_noise(document: DiagnosisDocument) -> str:
    """What an adequate model may lack where slow noise explains most of the residual; empty elsewhere."""
    floor, white = document["error"]["floor_ug"], document["error"].get("white_noise_ug")
    rows = hidden(document)
    if not document["adequate"] or not rows or floor is None or white is None or floor <= 2**0.5 * white:
        return ""
    sizes = ", ".join(f"{row['effect']} below {short(row['size_ug'], 2)} µg" for row in rows)
    return (
        f"white noise is {short(white)} µg, the rest counts as slow noise, which hides {sizes}; "
        "a second run shows what is repeated"
    )


def influences(document: DiagnosisDocument, most: int | None = NAMED_DWELLS) -> list[str]:
    """The dwells with the largest influence on each class, or on the verdict where nothing is named; none for an adequate model.

    Parameters
    ----------
    most : number of dwells that a sentence names; all where None
    """
    if document["adequate"]:
        return []
    if not document["classes"] and document["influence"]:
        return [_carried("largest residuals, share of all", document, most)]
    return [
        _carried(f"dwells with the largest influence on {' or '.join(group['effects'])}", group, most)
        for group in document["classes"]
        if group["effects"] != [BAD_DWELL]
    ]


def _carried(what: str, carried: EffectClassDocument | DiagnosisDocument, most: int | None) -> str:
    """Dwells with their shares, and the probability without them."""
    rows = carried["influence"][:most]
    dwells = (
        ", ".join(f"{d['unit']} dwell {d['dwell']} ({100.0 * d['share']:.0f} %)" for d in rows) or "no single dwell"
    )
    without = carried.get("without_influence")
    return f"{what}: {dwells}" + (
        f"; without these {without['dwells']} p {equal(without['p_value'])}" if without else ""
    )


def without_single_dwells(document: DiagnosisDocument) -> str:
    """The verdict without single dwells that have a fault, and the option that leaves them out; empty where there are none."""
    single = document.get("leave_out")
    if not single:
        return ""
    names = ",".join(f"{d['unit']}:{d['dwell']}" for d in single["dwells"])
    found = {True: "adequate", False: "NOT adequate", None: "cannot be judged"}[single["adequate_without"]]
    these = "these dwells" if len(single["dwells"]) > 1 else "this dwell"
    return f"without {these} the model is: {found}; to leave out: --leave-out {names}"


def tails_left_out(document: DiagnosisDocument) -> str:
    """The dwells that were left out but that the tails of the noise may explain; empty if there are none."""
    removed = document.get("removed")
    if not removed or not removed["heavy_tails"]:
        return ""
    tails = [d for d in removed["dwells"] if d.get("tail", True)]
    named = tails[:NAMED_DWELLS]
    names = ", ".join(f"{d['unit']} dwell {d['dwell']} ({d['deviations']:.1f})" for d in named)
    return (
        f"{number_of(len(tails), 'dwell')} left out (standard deviations): {names}"
        f"{' …' if len(tails) > len(named) else ''}; the tails of the noise of this run may reach as far"
    )


def left_out(document: DiagnosisDocument) -> list[str]:
    """Sentences on dwells that were left out of the judgement, and on the verdict without them."""
    removed = document.get("removed")
    count = len(removed["dwells"]) if removed and not removed["heavy_tails"] else 0
    were = "s were" if count > 1 else " was"
    counted = f"{count} single dwell{were} left out before the model was judged" if count else ""
    return [text for text in (without_single_dwells(document), tails_left_out(document), counted) if text]


def why_recommended(document: DiagnosisDocument) -> list[str]:
    """Reasons why named effects are not recommended for the model, or are recommended by their evidence alone."""
    lines: list[str] = []
    for group in document["classes"]:
        if group["scope"] == "data":
            continue
        added = [name for name in group["effects"] if name in document["recommended"]]
        if group["scope"] == "sensor or station":
            lines.append(
                f"{' or '.join(group['effects'])} can be of the sensors or of the station (table, fixture, reference): turn the "
                f"units in their seats, or measure them on another station.{_untried(document, *_ANGLES)}"
            )
        name, before, after = (added or group["effects"])[0], group.get("heldout_before_ug"), group["heldout_after_ug"]
        if after is None or before is None:
            lines.append(
                f"{name} is recommended by its evidence alone: no dwells left out can judge it; confirm with a fresh run of the "
                "same units."
            )
        elif not added and after > before:
            rise = f"rises from {short(before)} to {short(after)} µg"
            lines.append(f"{name} is not recommended: the error on dwells left out {rise}.")
    return lines


def not_listed(document: DiagnosisDocument) -> str:
    """A sentence with the number of effects that this plan cannot show, or only in part; empty where it shows all."""
    part = len({row["effect"] for row in document.get("unseen_in_part", ())})
    counts = (("cannot show {}", len(document["unseen"])), ("shows {} only in part", part))
    counted = [what.format(number_of(count, "effect")) for what, count in counts if count]
    return f"This plan {' and '.join(counted)}" if counted else ""


def unexplained_text(document: DiagnosisDocument) -> str:
    """The quantity that the residual depends on without an effect that explains it; empty if there is none."""
    unexplained = document["unexplained"]
    if not unexplained:
        return ""
    shape = "" if unexplained.get("period_s") else f" as a {unexplained['shape']}"
    untried = _untried(document, *(_ANGLES if unexplained["driver"] == "pose" else _TEMPERATURE))
    return f"{unexplained['text']}{shape} (p {equal(unexplained['p_value'])}).{untried}"


def suspected_text(document: DiagnosisDocument) -> str:
    """The most probable missing effects if none is named, and the measurement that decides; empty if none is suspected."""
    suspected = document.get("suspected")
    if not suspected:
        return ""
    names, left = " or ".join(suspected["effects"]), short(suspected["rms_after_ug"])
    return (
        f"suspected, but not named: {names}, which leaves {left} µg (p {equal(suspected['p_value'])} that noise explains as "
        f"much, p < {suspected['named_below']:g} is needed); to decide it: {suspected['breaker']}"
    )


def not_recorded(reason: str) -> str:
    """The missing column that a reason of :mod:`inertial.planning.reasons` names; empty for another reason."""
    match = _NOT_RECORDED.match(reason)
    return "" if match is None else match[1]


_ANGLES = ("outer_deg", "the table's angles", "record outer_deg and inner_deg")
_TEMPERATURE = ("unit_C", "temperatures", "record them in the column unit_C, in °C")
_MOST_UNTRIED = 4


def _untried(document: DiagnosisDocument, column: str, what: str, remedy: str) -> str:
    """A sentence on effects that could not be tried without a column; empty where it is recorded."""
    reasons = document.get("reasons", {})
    names = [name for name in document["unseen"] if not_recorded(reasons.get(name, "")) == column]
    if not names:
        return ""
    more = f" and {len(names) - _MOST_UNTRIED} more" if len(names) > _MOST_UNTRIED else ""
    return f" Without {what} {', '.join(names[:_MOST_UNTRIED])}{more} could not be tried: {remedy}."


def why_first(document: DiagnosisDocument) -> list[str]:
    """Why one effect of a class is proposed and not another one; empty where no class has several."""
    lines: list[str] = []
    for group in document["classes"]:
        first = next((name for name in group["effects"] if name in document["recommended"]), None)
        others = [name for name in group["effects"] if name != first]
        if first is not None and others:
            lines.append(
                f"{first} is proposed before {' and '.join(others)}: these data do not separate them, and it is the simplest of "
                "those that explain the residual best."
            )
    return lines


def cost_to_decide(document: DiagnosisDocument) -> list[str]:
    """Cost and gain of the next measurement, a line for each purpose; where none is possible, what would separate the class."""
    lines: list[str] = []
    rows = document["next_measurements"]
    for why in dict.fromkeys(row["why"] for row in rows):
        proposal = [row for row in rows if row["why"] == why]
        if not proposal[0].get("measurable", True) or "minutes" not in proposal[0]:
            lines.append(f"To decide: {why}")
            continue
        steps = number_of(sum(int(row.get("repeats", 1)) for row in proposal), "step")
        if why.startswith(UNSEEN):
            names, minutes = why.removeprefix(UNSEEN), short(proposal[0]["minutes"])
            lines.append(f"To see {names}, too: {steps}, {minutes} min of station time")
        else:
            lines.append(f"To decide: {steps} for {brings(proposal[0])}")
    return lines


def brings(row: NextMeasurement) -> str:
    """Station time and expected separation of the steps of a row of the next measurement."""
    text = f"{row['why']}: {short(row.get('minutes'))} min of station time; "
    before, after = row.get("separation_before", 0.0), row.get("separation_after", 0.0)
    if not (expected := row.get("separation_if")):
        return f"{text}χ² of a coefficient of typical size: {before:.1f} now, {after:.0f} expected"
    by_truth = ", ".join(f"{chi:.0f} if {name} is true" for name, chi in expected.items())
    parted = f"; not separated from the first: {', '.join(row['not_parted'])}" if "not_parted" in row else ""
    return f"{text}difference of their χ²: {before:.1f} now, expected {by_truth}{parted}"
