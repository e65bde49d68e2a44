"""A plan as text: station time, expected errors, reachable uncertainty, visible and hidden effects."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from inertial.counts import number_of
from pipelines.cli.next_commands import command_line, print_next
from pipelines.cli.printing import print_table, remark, say, short
from pipelines.planning.documents import worst_axes
from pipelines.stages.figures import plain_reason
from schemas.decisions import LARGEST_ERROR

RAISED = 3.0  # factor by which 1/f and random walk must raise a floor to be listed


def print_plan(document: dict[str, Any]) -> None:
    """Print a plan."""
    minutes, error = document["minutes"], document["dwell_error_ug"]
    say(
        f"{document['recipe']} with {document['device']} on station {document['station']}: "
        f"{number_of(document['dwells'], 'dwell')} in {number_of(document['poses'], 'pose')} at "
        f"{number_of(len(document['temperatures_C']), 'soak')}"
    )
    say(_time(minutes))
    say(
        f"error of a dwell (1σ): {short(error['together'])} µg; white {short(error['white'])}, wander {short(error['wander'])}"
        f"{_longer(document['dwell_s'])}"
    )
    _print_procedure_rows(document)
    print_table(["coefficient, unit", "error x, 1σ", "y", "z"], _coefficient_lines(document["coefficients"]))
    if document["bias"] is not None:
        bias = document["bias"]
        again = (
            "no repeatability is stated" if bias["switch_on_u_ug"] is None else f"{short(bias['switch_on_u_ug'])} µg"
        )
        say(
            f"standard uncertainty of the bias, worst axis: {short(bias['record_u_ug'])} µg as the mean over the measurement, "
            f"{short(bias['long_u_ug'])} µg on the day after it; after the next switch-on: {again}"
        )
    print_reach(document.get("uncertainty"))
    seen = [row for row in document["effects"] if row["seen"]]
    print_table(
        ["visible effect", "v", "1/v²", "floor, µg", "floor of the coefficient"], [_visible_line(row) for row in seen]
    )
    aliased = [[row["effect"], _aliases(row)] for row in seen if row["alias"]]
    if aliased:
        print_table(["visible effect", "confounded with"], aliased)
    faint = [row["effect"] for row in seen if row["faint"]]
    if faint:
        say(f"* seen only where larger than usual: {', '.join(faint)}")
    say(
        "v: fraction of the effect's column that remains after the model; 1/v²: variance inflation; floor: smallest detectable "
        "contribution to a dwell (3σ, RMS), and its coefficient; =: identical under this plan",
        style="dim",
    )
    raised = [r for r in seen if r["floor_white_ug"] and r["floor_size_ug"] > RAISED * r["floor_white_ug"]]
    if raised:
        raised.sort(key=lambda r: -r["floor_size_ug"] / r["floor_white_ug"])
        lines = [[r["effect"], short(r["floor_size_ug"]), short(r["floor_white_ug"]), r["breaker"]] for r in raised[:5]]
        heads = ["floor raised by slow noise", "floor\nµg", "white only\nµg", "what lowers it"]
        print_table(heads, lines)
    in_part = [
        [row["effect"], "; ".join(r["text"] for r in row["unseen_ranges"])] for row in seen if row["unseen_ranges"]
    ]
    if in_part:
        print_table(["effect visible in part", "not visible for"], in_part)
    invisible = [row for row in document["effects"] if not row["seen"]]
    print_table(
        ["effect not visible", "reason; what to add"], [[r["effect"], r["why"] or r["breaker"]] for r in invisible]
    )
    if "page" in document:
        say(f"Page: {document['page']}")


def print_procedures(document: dict[str, Any]) -> None:
    """Print the plan of a recipe without the multi-position test."""
    say(f"{document['recipe']} with {document['device']} on station {document['station']}")
    say(_time(document["minutes"]))
    _print_procedure_rows(document)


def _print_procedure_rows(document: dict[str, Any]) -> None:
    """Print the procedures of a plan with their figures; nothing for a recipe without a list."""
    rows = document.get("procedures", [])
    if not rows:
        return
    print_table(
        ["procedure", "records", "min", "°C", "equipment", "result"],
        [
            [
                row["procedure"],
                str(row["records"]),
                f"{row['minutes']:.1f}",
                ", ".join(f"{t:g}" for t in row["temperatures_C"]),
                ", ".join(row["equipment"]),
                row["states"],
            ]
            for row in rows
        ],
    )
    figures = [[f["figure"], f["unit"], f["limit"] or "", f["meaning"]] for row in rows for f in row["figures"]]
    print_table(["figure", "unit", "limit", "meaning"], figures)


def _time(minutes: dict[str, float]) -> str:
    parts = " + ".join(
        f"{name.replace('_', ' ')} {minutes[name]:.0f}" for name in minutes if name != "total" and minutes[name] > 0.0
    )
    return f"{minutes['total']:.0f} min of station time: {parts}"


def _longer(dwell: dict[str, float]) -> str:
    """The effect of longer dwells on the error, as a clause; empty without wander."""
    balanced = dwell["white_as_large_as_wander"]
    if not math.isfinite(balanced):
        return ""
    if balanced < dwell["planned"]:
        return "; longer dwells hardly reduce it"
    return f"; longer dwells reduce it, up to {short(balanced, 2)} s"


def _coefficient_lines(rows: list[dict[str, Any]]) -> list[list[str]]:
    """One line per coefficient with its three axes; one value for parameters of the station."""
    from pipelines.report.numbers import side_by_side

    lines = side_by_side(rows, lambda row: short(row["uncertainty_ug"]), "unit")
    axes = [["*" if "*" in line["cells"] else "x", "y", "z"] for line in lines]
    return [
        [f"{line['title']}, {line['unit']}", *(line["cells"].get(axis, "") for axis in columns)]
        for line, columns in zip(lines, axes, strict=True)
    ]


def _visible_line(row: dict[str, Any]) -> list[str]:
    from pipelines.report.numbers import scientific

    size = short(row["floor_size_ug"]) + (" *" if row["faint"] else "")
    v, inflation = short(row["left"]), short(row["variance_inflation"])
    return [row["effect"], v, inflation, size, f"{scientific(row['floor_ug'], short)} {row['floor_unit']}"]


def _aliases(row: dict[str, Any]) -> str:
    exact = set(row["alias_exact"])
    return ", ".join(f"={name}" if name in exact else name for name in row["alias"])


TITLES = {
    "bias": "bias",
    "scale": "scale",
    "misalignment": "misalignment",
    "bias_temperature": "bias over temperature",
    "scale_temperature": "scale over temperature",
    "verification_norm": "error in a verification pose, with noise",
    "bias_error": "error by the references alone",
    "bias_error_period": "error over the period, RMS",
    LARGEST_ERROR: "largest error of an axis over the period, 95 % bound",
}
LEAST = 0.01  # smallest share of a contribution that is printed


def print_reach(reach: dict[str, Any] | None) -> None:
    """A table of the quantities with their largest contributions, limits that cannot be met, and remarks."""
    if reach is None:
        say("uncertainty: noise only, the station states no [uncertainty]; no grade above consumer, no certificate")
        return
    from pipelines.report.numbers import axis_word

    worst = worst_axes(reach)
    of_period = {"bias_error_period", LARGEST_ERROR}  # bounds themselves
    lines = [
        [
            TITLES[name],
            "" if name == LARGEST_ERROR else axis_word(row["axis"]),
            short(row["u"]),
            "" if name in of_period else short(row["expanded"]),
            row["unit"],
        ]
        for name, row in worst.items()
    ]
    print_table(["quantity, worst axis", "axis", "u", "U, k = 2", "unit"], lines)
    for quantity, row in worst.items():
        rulers = ", ".join(f"{name} {100.0 * share:.0f} %" for name, share in row["shares"].items() if share >= LEAST)
        say(f"{TITLES[quantity]}: {rulers or 'no contribution'}")
    period = f"period of validity {reach['validity_months']} months, frame {reach['frame']}"
    say(f"{period}; references by {reach['grade_source'].replace('_', ' ')}", style="dim")
    if reach["grade_source"] == "assumed":
        say("references: assumed values, which allow no certificate")
    for name, rules in reach["not_stated"].items():
        say(f"not stated: {name} (dominates {rules})")
    for line in reach["remarks"]:
        say(line)
    for name, key in (("limit out of reach", "unreachable"), ("limit at risk", "at_risk")):
        for reason in reach[key]:
            say(f"{name}: {plain_reason(reason)}")


ERROR_HEADS = ("coefficient, unit", "error\n1σ", "required", "ratio", "given\n1σ")


def print_optimum(document: dict[str, Any], where: Sequence[str]) -> None:
    """Print the recipe found; ``where``: options that name its station and archive."""
    temperatures = ", ".join(f"{t:g}" for t in document["temperatures_C"])
    say(
        f"{document['recipe']}: {number_of(document['dwells'], 'dwell')} of {document['dwell_s']:g} s "
        f"in {document['poses']} poses, {'ramps to' if document['ramp'] else 'soaks at'} {temperatures} °C"
    )
    minutes, given, textbook = document["minutes"], document["own_minutes"], document["textbook_minutes"]
    parts = [
        [name.replace("_", " "), f"{minutes[name]:.0f}", f"{given[name]:.0f}", f"{textbook[name]:.0f}"]
        for name in minutes
    ]
    print_table(["station time, min", "new recipe", document["from"], "textbook plan"], parts)
    for line in _comparison(document):
        say(line)
    if document["rivals"]:
        lines = [[r["true"], r["wrong"], short(r["chi_square"]), short(r["textbook"])] for r in document["rivals"]]
        print_table(["true effect", "fitted effect", "χ², new recipe", "χ², textbook plan"], lines, fixed=2)
    else:
        print_table(ERROR_HEADS, _error_lines(document["coefficients"]))
        say(f"error: of the new recipe; given: of {document['from']}", style="dim")
    if document["seen_besides"]:
        say(f"Also visible, unlike with the textbook plan: {', '.join(document['seen_besides'])}")
    say(f"Recipe file: {document['file']}")
    if document["limits_missing"]:
        remark(f"warning: {document['limits_missing']}", style="yellow")
    else:
        print_next([command_line("run", str(document["file"]), *where)])
    if "page" in document:
        say(f"Page: {document['page']}")


def _comparison(document: dict[str, Any]) -> list[str]:
    """Sentences that compare the new recipe with the given recipe and the textbook plan."""
    name, more = document["from"], document["minutes"]["total"] - document["own_minutes"]["total"]
    difference = (
        f"{abs(more):.0f} min {'more' if more > 0.0 else 'less'} than {name}" if abs(more) >= 0.5 else f"as {name}"
    )
    first = (
        f"The new recipe takes {difference}, and {100.0 * document['share']:.0f} % of the textbook plan's time without the "
        f"static record; {number_of(document['verification_dwells'], 'dwell')} for verification (textbook plan: none)."
    )
    lines = [first]
    if document["bound"] is not None:
        lines.append(
            f"Measuring without a pause on ramps would need {100.0 * document['bound']['share']:.0f} %, for "
            f"{document['bound']['effect']}: lag, ramp and wander allow no less."
        )
    worst = document["own_worst"]
    if worst is not None:
        meets = "meets the required errors" if worst <= 1.0 else f"has up to {worst:.2f} times the required errors"
        lines.append(
            f"{name} {meets}." + ("" if worst <= 1.0 else f" For errors as in {name}, give --set factor={worst:.2f}.")
        )
        if worst <= 1.0 and more > 0.0:
            lines.append(f"{name} is quicker and meets the requirement: keep it.")
    if document["worst"] > 1.0:
        lines.append(
            "No recipe was found that reaches the textbook plan's errors for every coefficient; the nearest has up to "
            f"{document['worst']:.3f} times these errors. Set a larger factor, or fewer verification dwells, with --set."
        )
    return lines


def _error_lines(rows: list[dict[str, Any]]) -> list[list[str]]:
    count = Counter((r["effect"], r["axis"]) for r in rows)
    several = {effect for (effect, _), number in count.items() if number > 1}
    return [
        [
            f"{r['effect']} {r['axis']}{' ' + r['name'] if r['effect'] in several else ''}, {r['unit']}",
            short(r["uncertainty_ug"]),
            short(r["wanted_ug"]),
            f"{r['uncertainty_ug'] / r['wanted_ug']:.2f}",
            short(r["own_ug"]) or "–",
        ]
        for r in rows
    ]
