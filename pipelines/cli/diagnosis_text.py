"""A diagnosis for people: the verdict in a sentence, then faults, places, classes, the next command, and what was not seen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipelines.cli.evidence_text import print_evidence
from pipelines.cli.options import console, print_table, short, short_values

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console


BAD_DWELL = "bad_dwell"
HIDDEN, SHOWN = 3.0, 4
"""Factor by which slow noise must raise the smallest size that is named for an effect to be listed, and how many are."""
STYLE_OF = {True: "bold green", False: "bold red", None: "bold yellow"}
"""Of a verdict; None: it cannot be given."""

SMALL = 1.1
"""Errors below so many times the floor look like noise to whoever compares the two numbers."""


def print_diagnosis(document: dict[str, Any], *, source: str, model: Path | None, next_command: bool = True) -> None:
    """Print a diagnosis.

    Parameters
    ----------
    source : the dwells as they were named on the command line
    model : the model file as it was given there
    next_command : whether to print the commands that add the recommended effects
    """
    out = console()
    out.print(verdict(document), style=STYLE_OF[document["adequate"]], soft_wrap=True)
    print_evidence(document)
    print_findings(document)
    _unexplained(out, document, model)
    if next_command:
        _next_command(out, document, source, model)
    _unseen(document)
    from pipelines.cli.measurements_text import measurements_table

    measurements_table(document["next_measurements"])


def print_findings(document: dict[str, Any]) -> None:
    """Print data faults, the places where the model fails, and the classes of what is missing."""
    _faults(document["blocked_by"])
    _where(document["where"])
    _classes(document)
    _dwells(document)
    for text in document.get("warnings", ()):
        console().print(f"warning: {text}", style="yellow", markup=False, soft_wrap=True)


def _dwells(document: dict[str, Any]) -> None:
    """Dwells that were left out as tails of the noise, and those that carry the verdict."""
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
            markup=False,
            soft_wrap=True,
        )
    if removed and removed["heavy_tails"]:
        tails = [d for d in removed["dwells"] if d.get("tail", True)]
        names = ", ".join(f"{d['unit']} dwell {d['dwell']} ({d['deviations']:.1f})" for d in tails[:5])
        out.print(
            f"{len(tails)} dwell{'s' if len(tails) != 1 else ''} left out (standard deviations): {names}"
            f"{' …' if len(tails) > 5 else ''}; the noise of this run may have tails that reach as far",
            style="dim",
            markup=False,
            soft_wrap=True,
        )
    if document["adequate"]:
        return
    for group in document["classes"]:
        if group["effects"] != [BAD_DWELL]:
            text = f"dwells that carry {' or '.join(group['effects'])}: {_carried(group['influence'])}"
            without = group["without_influence"]
            if without:
                text += f"; without these {without['dwells']} p {equal(without['p_value'])}"
            out.print(text, style="dim", markup=False, soft_wrap=True)
    if not document["classes"] and document["influence"]:
        text = f"largest residuals, share of all: {_carried(document['influence'])}"
        without = document.get("without_influence")
        if without:
            text += f"; without these {without['dwells']} p {equal(without['p_value'])}"
        out.print(text, style="dim", markup=False, soft_wrap=True)


def _carried(rows: list[dict[str, Any]]) -> str:
    """Dwells with their shares, the first few of them."""
    return ", ".join(f"{d['unit']} dwell {d['dwell']} ({100.0 * d['share']:.0f} %)" for d in rows[:5]) or "none alone"


def symbol_of(name: str) -> str:
    """The symbol of an effect, or of what handling does."""
    from inertial import effects
    from inertial.criticism.handling import named

    handled = named(name)
    if handled is not None:
        return handled.symbol
    return effects.get(name).symbol if name in effects.catalogue() or ":" in name else "a single dwell"


def verdict(document: dict[str, Any]) -> str:
    """The verdict in one sentence with its numbers."""
    error, faulty = document["error"], {u for f in document["blocked_by"] for u in f["units"]}
    if error["rms_ug"] is None:
        return (
            f"CANNOT BE JUDGED: every unit ({len(faulty)}) has a data fault; no physics is judged until it is mended."
        )
    sound = len(document["units"]) - len(faulty)
    left = f"residual {short(error['rms_ug'])} µg rms over {sound} unit{'s' if sound != 1 else ''}"
    left += f"; noise of the measurement {short(error['floor_ug'])} µg rms (p {equal(error['p_value'])})"
    if document["adequate"]:
        return f"ADEQUATE: {left}."
    if document["adequate"] is None:
        return f"CANNOT BE JUDGED: {document.get('reason')}."
    if error["rms_ug"] < SMALL * error["floor_ug"]:
        left += "; the misfit is smaller than the noise, but significant"
    spoilt = [told_of(group) for group in document["classes"] if group["scope"] == "data"]
    named = [" or ".join(group["effects"]) for group in document["classes"] if group["scope"] != "data"]
    if spoilt:
        rest = f"; also missing: {', and '.join(named)}" if named else ""
        return f"NOT ADEQUATE: {left}; the data: {'; '.join(spoilt)}{rest}."
    if named:
        return f"NOT ADEQUATE: {left}; missing: {', and '.join(named)}."
    driver = (document["unexplained"] or {}).get("driver")
    rest = "nothing that was recorded explains the residual"
    if driver:
        rest = f"the residual follows {driver}, and no effect of the catalogue explains it"
    return f"NOT ADEQUATE: {left}; {rest}."


def told_of(group: dict[str, Any]) -> str:
    """What handling did, with the unit and the first dwell that it concerns, and the effects that explain as much."""
    units, dwells = group.get("units") or [], group.get("dwells") or []
    where = f"{', '.join(units) or 'all units'}{f', dwell {dwells[0]}' if dwells else ''}"
    return f"{' or '.join(group['effects'])} ({where})"


def chance(p: float | None) -> str:
    """A probability for people."""
    if p is None:
        return ""
    if p <= 1e-299:
        return "< 1e-299"
    return short(p, 2) if p > 1e-3 else f"{p:.0e}"


def equal(p: float) -> str:
    """A probability with its sign: equal, or below the smallest that is told."""
    text = chance(p)
    return text if text.startswith("<") else f"= {text}"


def _faults(faults: list[dict[str, Any]]) -> None:
    if faults:
        lines = [[f["fault"], ", ".join(f["units"]), _numbers(f["dwells"]), f["evidence"]] for f in faults]
        print_table(
            ["fault", "unit", "dwells", "evidence"],
            lines,
            title="Data faults: mend these first; these units are left out",
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
        print_table(["follows", "axes", "of the excess", "p"], lines, title="Where the model fails")


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
        errors = short(group["rms_after_ug"]), short(group["heldout_after_ug"])
        text = group.get("evidence") or values
        lines.append([names, group["scope"], size, chance(group["p_value"]), *errors, text])
    columns = ["effect", "of the", "size\nµg", "p", "left\nµg", "left out\nµg", "with"]
    title = "What is missing; effects in one row cannot be told apart by these data"
    print_table(columns, lines, title=title, whole=6)
    if any(not group["plausible"] for group in document["classes"]):
        console().print(
            "(!) a size that this effect has not been seen to reach: look for another cause, too", markup=False
        )
    legend = (
        "left: error after it is added · left out: on dwells not fitted, the worst of poses, soaks, stretches of time"
    )
    console().print(legend, style="dim", markup=False)


def _parameters_of(group: dict[str, Any], effects: Any) -> str:
    """Nonlinear parameters with the effect of the class that they are of; several effects may be in one row."""
    name = group.get("nonlinear_of") or group["effects"][0]
    if group["scope"] == "data" or not group["nonlinear"]:
        return ""
    known = [p for p in effects.get(name).nonlinear if group["nonlinear"].get(p.name) is not None]
    values = ", ".join(f"{p.name} = {short_values(group['nonlinear'][p.name])} {p.unit}".rstrip() for p in known)
    return f"{name}: {values}" if values and len(group["effects"]) > 1 else values


def recommended_of(document: dict[str, Any], group: dict[str, Any]) -> str:
    """The member of a class that is recommended."""
    return next((name for name in document["recommended"] if name in group["effects"]), group["effects"][0])


def _unexplained(out: Console, document: dict[str, Any], model: Path | None) -> None:
    found = document["unexplained"]
    if not found:
        return
    out.print(
        f"\nReal, but no physics known for it: the error follows {found['driver']} in a {found['shape']} "
        f"(p {equal(found['p_value'])}).",
        markup=False,
        soft_wrap=True,
    )
    if document["offer"]:
        out.print(f"As a formula, to paste into {model or 'a model file'} and refine:\n", markup=False, soft_wrap=True)
        out.print(document["offer"]["toml"], markup=False, soft_wrap=True)
        out.print(
            f"\nthen  tumbleline extend {model or 'model.toml'} {document['offer']['id']}", markup=False, soft_wrap=True
        )


def _next_command(out: Console, document: dict[str, Any], source: str, model: Path | None) -> None:
    if not document["recommended"]:
        return
    from pipelines.jobs.model_files import STARTING_MODEL

    file = str(model or free_name())
    judged = ",".join(document["effects"])
    start = "" if (model and model.exists()) or judged == ",".join(STARTING_MODEL) else f" --effects {judged}"
    history = f" --history {document['history']}" if document.get("history") else ""
    fresh = " --fresh-history ITS-HISTORY" if history else ""
    out.print("\nNext:", style="bold")
    for place, name in enumerate(document["recommended"]):
        out.print(f"  tumbleline extend {file} {name}{start if place == 0 else ''}", markup=False, soft_wrap=True)
    out.print(
        f"  tumbleline history {file} --dwells {source}{history} --fresh ANOTHER-RUN-OF-THE-SAME-UNITS{fresh}",
        markup=False,
        soft_wrap=True,
    )
    added = set(document["recommended"])
    several = [g["effects"] for g in document["classes"] if len(g["effects"]) > 1 and added & set(g["effects"])]
    if several:
        told = "; ".join(" or ".join(effects) for effects in several)
        out.print(
            f"These data do not tell apart: {told}. What is added is one of the class.", style="dim", soft_wrap=True
        )


def free_name() -> str:
    """A name for a new model file: one that is there belongs to another model."""
    from pathlib import Path

    names = ("model.toml", *(f"model-{k}.toml" for k in range(2, 1000)))
    return next(name for name in names if not Path(name).exists())


def _unseen(document: dict[str, Any]) -> None:
    if document["unseen"]:
        reasons = document.get("reasons", {})
        lines = [[name, reasons.get(name) or document["breakers"][name]] for name in document["unseen"]]
        print_table(["effect", "why, and what would show it"], lines, title="This plan could not have seen", whole=1)
    parts: dict[str, list[str]] = {}
    for row in document.get("unseen_in_part", ()):
        parts.setdefault(row["effect"], []).append(row["text"])
    if parts:
        lines = [[name, "; ".join(texts)] for name, texts in parts.items()]
        print_table(["effect", "not visible for"], lines, title="This plan could have seen only in part", whole=1)
    _hidden_by_noise(document.get("smallest_named", ()))


def _hidden_by_noise(rows: list[dict[str, Any]]) -> None:
    """Effects that 1/f or random walk of this size imitates, up to what size, and what would show smaller ones."""
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
        columns = ["effect", "named from\nµg rms", "with white noise only\nµg rms", "what would show less"]
        print_table(columns, lines, title="Slow noise (1/f, random walk) imitates these effects", whole=1)
