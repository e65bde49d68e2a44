"""A diagnosis for people: the verdict in a sentence, then data faults, drivers, classes, the next command, hidden effects."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inertial.uncertainty.rounding import chance, equal
from pipelines.cli.evidence_text import print_evidence
from pipelines.cli.next_commands import FindData, JudgedData, command_line, print_extension, print_next
from pipelines.cli.options import console, print_table, short, short_values
from pipelines.cli.text.verdict_text import STYLE_OF, verdict

if TYPE_CHECKING:
    from rich.console import Console


BAD_DWELL = "bad_dwell"
HIDDEN, SHOWN = 3.0, 4
"""Factor by which slow noise must raise the smallest detectable size of an effect to list it, and the number of effects
listed."""


def print_diagnosis(document: dict[str, Any], *, data: FindData | None, model: Path | None) -> None:
    """Print a diagnosis.

    Parameters
    ----------
    data : gives the data as they were named on the command line, where commands to give next are printed; None: none are printed
    model : the model file as it was given there
    """
    out = console()
    out.print(verdict(document), style=STYLE_OF[document["adequate"]], soft_wrap=True)
    print_evidence(document)
    print_findings(document)
    _unexplained(out, document, data, model)
    if data is not None:
        _next_command(out, document, data, model)
    _unseen(document)
    from pipelines.cli.measurements_text import measurements_table

    measurements_table(document["next_measurements"])


def print_findings(document: dict[str, Any]) -> None:
    """Print data faults, the drivers that the residual follows, and the classes of missing effects."""
    _faults(document["blocked_by"])
    _where(document["where"])
    _classes(document)
    _dwells(document)
    for text in document.get("warnings", ()):
        console().print(f"warning: {text}", style="yellow")


def _dwells(document: dict[str, Any]) -> None:
    """Print the dwells left out as tails of the noise, and the dwells with the largest influence on the verdict."""
    removed, out = document.get("removed"), console()
    single = document.get("leave_out")
    if single:
        names = ",".join(f"{d['unit']}:{d['dwell']}" for d in single["dwells"])
        verdict_without = {True: "adequate", False: "NOT adequate", None: "cannot be judged"}[
            single["adequate_without"]
        ]
        out.print(
            f"without {'these dwells' if len(single['dwells']) > 1 else 'this dwell'} the model is: {verdict_without}; "
            f"to leave out: --leave-out {names}",
        )
    if removed and removed["heavy_tails"]:
        tails = [d for d in removed["dwells"] if d.get("tail", True)]
        names = ", ".join(f"{d['unit']} dwell {d['dwell']} ({d['deviations']:.1f})" for d in tails[:5])
        out.print(
            f"{len(tails)} dwell{'s' if len(tails) != 1 else ''} left out (standard deviations): {names}"
            f"{' …' if len(tails) > 5 else ''}; the tails of the noise of this run may reach as far",
            style="dim",
        )
    if document["adequate"]:
        return
    for group in document["classes"]:
        if group["effects"] != [BAD_DWELL]:
            text = (
                f"dwells with the largest influence on {' or '.join(group['effects'])}: {_carried(group['influence'])}"
            )
            without = group["without_influence"]
            if without:
                text += f"; without these {without['dwells']} p {equal(without['p_value'])}"
            out.print(text, style="dim", soft_wrap=True)
    if not document["classes"] and document["influence"]:
        text = f"largest residuals, share of all: {_carried(document['influence'])}"
        without = document.get("without_influence")
        if without:
            text += f"; without these {without['dwells']} p {equal(without['p_value'])}"
        out.print(text, style="dim", soft_wrap=True)


def _carried(rows: list[dict[str, Any]]) -> str:
    """Dwells with their shares, the first few of them."""
    return (
        ", ".join(f"{d['unit']} dwell {d['dwell']} ({100.0 * d['share']:.0f} %)" for d in rows[:5]) or "no single dwell"
    )


def symbol_of(name: str) -> str:
    """The symbol of an effect, or of a handling error."""
    from inertial import effects
    from inertial.data_errors.handling import named

    handled = named(name)
    if handled is not None:
        return handled.symbol
    return effects.get(name).symbol if name in effects.catalogue() or ":" in name else "a single dwell"


def _faults(faults: list[dict[str, Any]]) -> None:
    if faults:
        lines = [[f["fault"], ", ".join(f["units"]), _numbers(f["dwells"]), f["evidence"]] for f in faults]
        print_table(
            ["fault", "unit", "dwells", "evidence"],
            lines,
            title="Data faults: correct these first; these units are left out",
        )


def _numbers(dwells: list[int]) -> str:
    if len(dwells) > 4:
        return f"{len(dwells)}, from {dwells[0]} on"
    return ", ".join(map(str, dwells)) or "all"


def _where(places: list[dict[str, Any]]) -> None:
    if places:
        lines = [
            [p["driver"], " ".join(p["axes"]), f"{100.0 * p['share']:.0f} %", chance(p["p_value"])] for p in places[:8]
        ]
        print_table(["driver", "axes", "share of excess", "p"], lines, title="Drivers of the residual")


def _classes(document: dict[str, Any]) -> None:
    from inertial import effects

    if not document["classes"]:
        return
    lines = []
    for group in document["classes"]:
        names = "\n".join(f"{name} ({symbol_of(name)})" for name in group["effects"])
        values = _parameters_of(group, effects)
        size = short(group["size_ug"]) if group["size_ug"] > 0.0 else "within noise"
        size += "" if group["plausible"] else " (!)"
        errors = short(group["rms_after_ug"]), short(group["heldout_after_ug"]) or "–"
        text = group.get("evidence") or values
        lines.append([names, group["scope"], size, chance(group["p_value"]), *errors, text])
    columns = ["effect", "scope", "size\nµg", "p", "residual\nµg", "cross-validated\nµg", "parameters"]
    title = "Missing effects; these data cannot separate the effects of one row"
    print_table(columns, lines, title=title)
    if any(not group["plausible"] for group in document["classes"]):
        console().print("(!) larger than the usual size of this effect: check other causes, too")
    legend = (
        "residual: with the effect added · cross-validated: on dwells not fitted, the worst of poses, soaks, stretches of "
        "time"
    )
    if any(group["heldout_after_ug"] is None for group in document["classes"]):
        legend += " · –: no dwells left out can judge it"
    if any(group.get("nonlinear_interval") for group in document["classes"]):
        legend += " · in brackets: 68 % interval"
    console().print(legend, style="dim")
    for line in why_not_recommended(document):
        console().print(line, soft_wrap=True)


def why_not_recommended(document: dict[str, Any]) -> list[str]:
    """Why effects that are named are not recommended for the model."""
    lines: list[str] = []
    for group in document["classes"]:
        if group["scope"] == "data" or set(group["effects"]) & set(document["recommended"]):
            continue
        name, before, after = group["effects"][0], group.get("heldout_before_ug"), group["heldout_after_ug"]
        if after is None or before is None:
            why = "no dwells left out can judge it; a fresh run of the same units decides"
        elif after > before:
            why = f"the error on dwells left out rises from {short(before)} to {short(after)} µg"
        else:
            continue
        lines.append(f"{name} is not recommended: {why}.")
    return lines


def _parameters_of(group: dict[str, Any], effects: Any) -> str:
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


def recommended_of(document: dict[str, Any], group: dict[str, Any]) -> str:
    """The member of a class that is recommended."""
    return next((name for name in document["recommended"] if name in group["effects"]), group["effects"][0])


def _with_formula(document: dict[str, Any], data: JudgedData) -> str:
    """The command that judges the model with the suggested formula, without a model file."""
    offer = document["offer"]
    formula = f"{offer['id']}={'; '.join(offer['columns'])}"
    effects = ",".join([*document["effects"], offer["id"]])
    return command_line("diagnose", data.source, "--effects", effects, "--formula", formula, *data.options)


def _unexplained(out: Console, document: dict[str, Any], data: FindData | None, model: Path | None) -> None:
    unexplained = document["unexplained"]
    if not unexplained:
        return
    out.print(
        f"\nSignificant, but of unknown cause: {unexplained['text']} as a {unexplained['shape']} "
        f"(p {equal(unexplained['p_value'])}).",
    )
    if document["offer"]:
        out.print(f"Formula for {model or 'a model file'}, to be refined:\n")
        out.print(document["offer"]["toml"], soft_wrap=True)
        if data is not None:
            print_next(out, [_with_formula(document, data())])


def _next_command(out: Console, document: dict[str, Any], data: FindData, model: Path | None) -> None:
    if not document["recommended"]:
        return
    print_extension(out, document, data, model)
    added = set(document["recommended"])
    several = [g["effects"] for g in document["classes"] if len(g["effects"]) > 1 and added & set(g["effects"])]
    if several:
        alternatives = "; ".join(" or ".join(effects) for effects in several)
        out.print(
            f"These data do not separate: {alternatives}. The added effect is one of its class.",
            style="dim",
        )


def _unseen(document: dict[str, Any]) -> None:
    if document["unseen"]:
        console().print()
        reasons = document.get("reasons", {})
        lines = [[name, reasons.get(name) or document["breakers"][name]] for name in document["unseen"]]
        print_table(
            ["effect", "reason, and measurement that shows it"],
            lines,
            title="Effects that this plan cannot show",
            whole=1,
        )
    parts: dict[str, list[str]] = {}
    for row in document.get("unseen_in_part", ()):
        parts.setdefault(row["effect"], []).append(row["text"])
    if parts:
        lines = [[name, "; ".join(texts)] for name, texts in parts.items()]
        print_table(["effect", "not visible for"], lines, title="Effects that this plan shows only in part", whole=1)
    _hidden_by_noise(document.get("smallest_named", ()))


def _hidden_by_noise(rows: list[dict[str, Any]]) -> None:
    """Print the effects that 1/f noise or random walk of this size hides, with the measurement for smaller sizes."""
    from inertial import effects

    raised = [row for row in rows if row["size_ug"] > HIDDEN * row["without_slow_noise_ug"]][:SHOWN]
    if raised:
        lines = [
            [
                r["effect"],
                short(r["size_ug"], 2),
                short(r["without_slow_noise_ug"], 2),
                effects.get(r["effect"]).breaker,
            ]
            for r in raised
        ]
        columns = ["effect", "smallest size\nµg rms", "with white noise only\nµg rms", "measurement for smaller sizes"]
        print_table(columns, lines, title="Effects hidden by slow noise (1/f, random walk)", whole=1)
