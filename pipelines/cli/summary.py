"""The result of a run in short: one line per slot, for people and as JSON."""

from typing import Any

from inertial.counts import number_of
from pipelines.archive import Run
from pipelines.capture.interruptions import Interruptions, interruptions
from pipelines.cli.printing import STYLES, print_table, say, short
from pipelines.report.reasons import grouped_reasons
from pipelines.schedule.early_end import EarlyEnd, early_end, early_end_sentence, told_sentences
from pipelines.tables.frames import rows_of
from pipelines.tables.json_values import json_value
from pipelines.tables.prior import prior_document, prior_sentence

SHOWN = (
    ("residual_rms_ug", "fit\nµg"),
    ("verification_norm_ug", "verify |a|\nµg"),
    ("bias_error_ug", "error\nµg"),
    ("bias_error_period_ug", "period\nµg"),
    ("velocity_random_walk_ug_rtHz", "N\nµg/√Hz"),
    ("bias_instability_ug", "B\nµg"),
)

FIXED = ("value", "uncertainty", "limit", "unit_text", "outcome", "rule")
RISKS = ("accept", "pfa", "pfr", "least")  # runs of earlier versions have none
NOISE_ONLY = (
    "uncertainty: noise only, the station states no [uncertainty]: no grade above consumer, no certificate "
    "(docs/how-to/state-the-uncertainty.md)"
)

LEGEND = {
    "residual_rms_ug": "fit: rms residual of the dwells that are fitted",
    "verification_norm_ug": "verify: largest error of |a|, the magnitude of gravity, in a pose not used, mean of its dwells",
    "bias_error_ug": "error: rms of the worst axis in these poses, so it may exceed verify",
    "bias_error_period_ug": "period: 95 % bound of the largest rms error of an axis at the end of the period of validity",
}
NOISE_LEGEND = "N, B: noise of the worst axis, an upper limit where a term is not identified"


def summary(run: Run) -> dict[str, Any]:
    """The result of a run: outcome, grade, reasons and figures of each unit; the yield; the path of the report."""
    grades, figures = run.table("grades"), run.table("figures")
    units: list[dict[str, Any]] = []
    for row in rows_of(grades.sort_values("slot")):
        of_unit = rows_of(figures[figures["unit"] == row["unit"]])
        cells = {f["figure"]: {k: f[k] for k in (*FIXED, *RISKS) if k in f} for f in of_unit}
        units.append(json_value({**row, "figures": cells}))
    outcomes = [unit["outcome"] for unit in units]
    return {
        "run": run.id,
        "recipe": run.about["recipe"]["name"],
        "effects": run.about["recipe"]["effects"],
        "rule": str(grades["rule"].iloc[0]),
        "units": units,
        "passed": outcomes.count("pass"),
        "failed": outcomes.count("fail"),
        "refused": outcomes.count("refused"),
        "yield": outcomes.count("pass") / len(units),
        "prior": prior_document(run.table("prior"), run.about) if "prior" in run.tables() else None,
        "early_end": early_end(run),
        "interruptions": interruptions(run),
        "report": str(run.report),
        "archive": str(run.archive.root),
    }


def all_passed(document: dict[str, Any]) -> bool:
    """Whether every unit passed."""
    return document["passed"] == len(document["units"])


def print_summary(document: dict[str, Any]) -> None:
    """The result for people."""
    from rich.text import Text

    lines: list[list[str | Text]] = []
    measured = {name for unit in document["units"] for name in unit["figures"]}  # without a static record there is no N
    limited = _limited(document)
    calibrated = bool(measured & dict(SHOWN).keys()) or not limited
    columns = (*(SHOWN if calibrated else ()), *limited)
    shown = [(name, head) for name, head in columns if name in measured or not measured]
    for unit in document["units"]:
        values = [short(unit["figures"].get(name, {}).get("value")) for name, _ in shown]
        outcome = Text(unit["outcome"], style=STYLES[unit["outcome"]])
        lines.append([str(unit["slot"]), unit["unit"], outcome, unit["grade"], *values])
    print_table(["slot", "unit", "result", "grade", *(title for _, title in shown)], lines)
    if calibrated:
        say(" · ".join(LEGEND[name] for name, _ in shown if name in LEGEND), style="dim")
        if any(name == "velocity_random_walk_ug_rtHz" for name, _ in shown):
            say(NOISE_LEGEND, style="dim")
    for group in grouped_reasons(document["units"]):
        say(f"  {group.sentence}")
    say(f"  decided by {document['rule']}", style="dim")
    if any(unit.get("basis") != "budget" for unit in document["units"]):
        say(f"  {NOISE_ONLY}", style="dim")
    for line in _interrupted(document["interruptions"]):
        say(line)
    for line in _ended(document["early_end"]):
        say(line)
    if document["prior"] is not None:
        say(prior_sentence(document["prior"]))
    total = len(document["units"])
    say(f"{document['passed']} of {total} passed, {document['failed']} failed, {document['refused']} refused")
    say(f"run     {document['run']}")
    say(f"report  {document['report']}")


def print_result(document: dict[str, Any]) -> None:
    """The result of a run for people, with the verdicts on its model and on its references."""
    from pipelines.cli.text.verdict_text import print_adequacy, print_references

    print_summary(document)
    print_adequacy(document["adequacy"])
    print_references(document["references"])


def _limited(document: dict[str, Any]) -> list[tuple[str, str]]:
    """Figures of procedures that have a limit, with their heads."""
    from pipelines.procedures import FIGURES
    from pipelines.stages.figures import figure_label

    heads: dict[str, str] = {}
    for unit in document["units"]:
        for name, figure in unit["figures"].items():
            if name in FIGURES and figure["outcome"] != "no limit":
                unit_text = "" if figure["unit_text"] == "1" else figure["unit_text"]
                heads[name] = f"{figure_label(name)}\n{unit_text}"
    return list(heads.items())


def _ended(end: EarlyEnd | None) -> list[str]:
    """The early end of a run as lines, and the units that were told to fail before."""
    if end is None:
        return []
    return [*told_sentences(end), *filter(None, [early_end_sentence(end)])]


def _interrupted(interrupted: Interruptions | None) -> list[str]:
    """The interruptions of a run as lines; empty if there were none."""
    if not interrupted or not interrupted["events"]:
        return []
    opened = interrupted["door_opened"]
    door = f", the door was opened {number_of(opened, 'time')}" if opened else ""
    head = f"  station: {number_of(interrupted['pauses'], 'pause')} ({interrupted['paused_s'] / 60.0:.1f} min waited){door}"
    dwells = [
        f"  dwell {dwell['record']} (pose {dwell['pose']}) measured again {number_of(dwell['times'], 'time')}: "
        f"{'; '.join(dwell['reasons'])}"
        for dwell in interrupted["repeated_dwells"]
    ]
    return [head, *dwells]
