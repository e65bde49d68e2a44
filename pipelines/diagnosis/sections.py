"""The tables of a diagnosis with their sentences, shared by terminal, report and page."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from inertial import effects
from inertial.counts import number_of
from inertial.data_errors.handling import named as handling_error
from inertial.quantities import BY_COLUMN
from inertial.uncertainty.rounding import chance, short, short_values
from pipelines.diagnosis import sentences
from pipelines.diagnosis.documents import DiagnosisDocument, EffectClassDocument, NextMeasurement

DRIVERS = 8
"""Drivers of the residual that a terminal lists."""

Number = tuple[str, str]
"""Heading of a column of numbers: name and unit, "" for numbers without a unit. That of a column of text is a name alone."""


@dataclass(frozen=True)
class Section:
    """A table with its title, and the sentences below it, which may exist without rows."""

    title: str
    columns: tuple[str | Number, ...]
    rows: list[list[str]]
    notes: list[str]

    def filled(self) -> list[int]:
        """The columns that have an entry."""
        return [k for k in range(len(self.columns)) if any(row[k] for row in self.rows)]

    def heads(self, join: str) -> list[str]:
        """The headings, ``join`` between a name and its unit."""
        return [column if isinstance(column, str) else join.join(filter(None, column)) for column in self.columns]


def faults(document: DiagnosisDocument) -> Section:
    """The data faults."""
    rows = [[f["fault"], ", ".join(f["units"]), _numbers(f["dwells"]), f["evidence"]] for f in document["blocked_by"]]
    title = "Data faults: correct these first; these units are left out"
    return Section(title, ("fault", "unit", ("dwells", ""), "evidence"), rows, [])


def fault_lines(document: DiagnosisDocument) -> list[str]:
    """The data faults, each in a line."""
    rows = faults(document).rows
    return [f"data fault of {unit} (not judged): {name}, dwells {at}: {text}" for name, unit, at, text in rows]


def _numbers(dwells: list[int]) -> str:
    if len(dwells) > 4:
        return f"{len(dwells)}, from {dwells[0]} on"
    return ", ".join(map(str, dwells)) or "all"


def drivers(document: DiagnosisDocument, most: int | None = DRIVERS) -> Section:
    """The recorded quantities that the residual depends on, at most ``most`` of them; all if None."""
    rows = [
        [p["driver"], " ".join(p["axes"]), f"{100.0 * p['share']:.0f} %", chance(p["p_value"])]
        for p in document["where"][:most]
    ]
    return Section("Drivers of the residual", ("driver", "axes", ("share of excess", ""), ("p", "")), rows, [])


def missing(document: DiagnosisDocument) -> Section:
    """The classes of missing effects, in the order of the document."""
    rows: list[list[str]] = []
    for group in document["classes"]:
        names = "\n".join(f"{name} ({symbol_of(name)})" for name in group["effects"])
        size = short(group["size_ug"]) if group["size_ug"] > 0.0 else "within noise"
        size += "" if group["plausible"] else " (!)"
        errors = short(group["rms_after_ug"]), short(group["heldout_after_ug"]) or "–"
        text = group.get("evidence") or parameters_of(group)
        rows.append([names, group["scope"], size, chance(group["p_value"]), *errors, text])
    numbers = ("size", "µg"), ("p", ""), ("residual", "µg"), ("cross-validated", "µg")
    columns = ("effect", "scope", *numbers, "parameters")
    title = "Missing effects; these data cannot separate the effects of one row"
    return Section(title, columns, rows, _legend(document) if rows else [])


def _legend(document: DiagnosisDocument) -> list[str]:
    """The meaning of the columns and marks of the missing effects."""
    groups = document["classes"]
    legend = (
        "residual: with the effect added · cross-validated: on dwells not fitted, the worst of poses, soaks, stretches of "
        "time"
    )
    if any(group["heldout_after_ug"] is None for group in groups):
        legend += " · –: no dwells left out can judge it"
    if any(group.get("nonlinear_interval") for group in groups):
        legend += " · in brackets: 68 % interval"
    unusual = "(!) larger than the usual size of this effect: check other causes, too"
    marks = [] if all(group["plausible"] for group in groups) else [unusual]
    return [*marks, legend]


def symbol_of(name: str) -> str:
    """The symbol of an effect, or of a handling error."""
    known = handling_error(name)
    if known is not None:
        return known.symbol
    return effects.get(name).symbol if name in effects.catalogue() or ":" in name else "a single dwell"


def parameters_of(group: EffectClassDocument) -> str:
    """Nonlinear parameters with the effect that they belong to; a row may have several effects."""
    name = group.get("nonlinear_of") or group["effects"][0]
    if group["scope"] == "data" or not group["nonlinear"]:
        return ""
    known = [p for p in effects.get(name).nonlinear if group["nonlinear"].get(p.name) is not None]
    between = group.get("nonlinear_interval") or {}
    values = ", ".join(
        f"{p.name} = {short_values(group['nonlinear'][p.name])}{_within(between.get(p.name))} {p.unit}".rstrip()
        for p in known
    )
    return f"{name}: {values}" if values and len(group["effects"]) > 1 else values


def _within(interval: Sequence[float] | None) -> str:
    """The 68 % interval behind a value."""
    return f" ({short(interval[0])} to {short(interval[1])})" if interval else ""


def next_measurement(proposed: Sequence[NextMeasurement]) -> Section:
    """The next measurement step by step, with station time, expected separation, and classes that no steps separate."""
    steps = [p for p in proposed if p.get("measurable", True)]
    rows = [
        [
            short(p["outer_deg"]),
            short(p["inner_deg"]),
            short(p["chamber_C"]) + ("" if p.get("soaked", True) else " (during the ramp)"),
            short(p.get("wait_s")) + (f" after {short(p['off_s'] / 60.0)} min off" if "off_s" in p else ""),
            str(p.get("repeats", 1)),
            p["why"],
        ]
        for p in steps
    ]
    columns = (("outer", "°"), ("inner", "°"), ("chamber", "°C"), ("wait", "s"), ("times", ""), "purpose")
    notes = [sentences.brings(row) for row in {p["why"]: p for p in steps if "minutes" in p}.values()]
    notes += [row["why"] for row in proposed if not row.get("measurable", True)]
    return Section("Measure next, in this order", columns, rows, notes)


def unseen(document: DiagnosisDocument, *, brief: bool = False) -> Section:
    """The effects that the plan cannot show.

    Parameters
    ----------
    brief : whether effects of quantities that were not recorded are only counted, in one sentence
    """
    reasons = document.get("reasons", {})
    rows = [[name, reasons.get(name) or document["breakers"][name]] for name in document["unseen"]]
    counts = Counter(column for _, text in rows if brief and (column := sentences.not_recorded(text)))
    shown = [row for row in rows if not (brief and sentences.not_recorded(row[1]))]
    listed = ", ".join(f"{_quantity(column)} ({number_of(count, 'effect')})" for column, count in counts.most_common())
    notes = [f"not recorded: {listed}; --all lists them"] if listed else []
    return Section(
        "Effects that this plan cannot show", ("effect", "reason, and measurement that shows it"), shown, notes
    )


def _quantity(column: str) -> str:
    """A recorded quantity for people."""
    return {"outer_deg": "angles of a table", "unit_C": "temperature"}.get(column) or (
        BY_COLUMN[column].label if column in BY_COLUMN else column
    )


def unseen_in_part(document: DiagnosisDocument) -> Section:
    """The effects that the plan shows at some values of their parameters only."""
    parts: dict[str, list[str]] = {}
    for row in document.get("unseen_in_part", ()):
        parts.setdefault(row["effect"], []).append(row["text"])
    rows = [[name, "; ".join(texts)] for name, texts in parts.items()]
    return Section("Effects that this plan shows only in part", ("effect", "not visible for"), rows, [])


def hidden_by_noise(document: DiagnosisDocument) -> Section:
    """Effects whose smallest detectable size 1/f noise or random walk raises most, with the measurement for smaller sizes."""
    rows = [
        [r["effect"], short(r["size_ug"], 2), short(r["without_slow_noise_ug"], 2), effects.get(r["effect"]).breaker]
        for r in sentences.hidden(document)
    ]
    numbers = ("smallest size", "µg rms"), ("with white noise only", "µg rms")
    columns = ("effect", *numbers, "measurement for smaller sizes")
    return Section("Effects hidden by slow noise (1/f, random walk)", columns, rows, [])


def worded(document: DiagnosisDocument) -> dict[str, Any]:
    """A diagnosis as its tables and sentences by name, for a template."""
    return {
        "verdict": sentences.verdict(document),
        "cards": sentences.cards(document),
        "evidence": sentences.evidence_text(document),
        "undetected": "; ".join(filter(None, (sentences.undetected(document), sentences.slow_noise(document)))),
        "faults": faults(document),
        "drivers": drivers(document, None),
        "missing": missing(document),
        "why_first": sentences.why_first(document),
        "cost": sentences.cost_to_decide(document),
        "not_listed": sentences.not_listed(document),
        "recommended": sentences.why_recommended(document),
        "influences": sentences.influences(document, None),
        "left_out": sentences.left_out(document),
        "unexplained_title": sentences.UNEXPLAINED,
        "unexplained": sentences.unexplained_text(document),
        "next_measurement": next_measurement(document["next_measurements"]),
        "unseen": unseen(document),
        "unseen_in_part": unseen_in_part(document),
        "shown_by": {row["effect"]: row["breaker"] for row in document.get("unseen_in_part", ())},
        "hidden_by_noise": hidden_by_noise(document),
    }
