"""Discoveries for people: what differs by what, how large it is, why it is beyond chance, and what to do next."""

from collections.abc import Sequence

from inertial.counts import number_of
from pipelines.cli.next_commands import command_line, print_next
from pipelines.cli.printing import print_table, say, short
from pipelines.discovery.documents import DiscoverDocument, DiscoveryRow, PopulationRow, UnexplainedRow
from pipelines.discovery.sentences import headline, scope_text, support_text, unexplained_text

_SHOWN_HELD, _SHOWN_LEVELS, _SHOWN_OUT, _SHOWN_REACH = 3, 12, 3, 40


def print_discoveries(document: DiscoverDocument, again: Sequence[str] = (), *, reach: bool = False) -> None:
    """The screen of ``discover``; with ``reach`` also what the archive could have shown.

    again : options that the next command needs as well
    """
    pooled, control = document["pooled"], document["error_control"]
    period = f", {pooled['from']} to {pooled['until']}" if pooled["from"] else ""
    say(
        f"{number_of(pooled['lots'], 'lot')} of {document['device']}, {number_of(pooled['units'], 'unit calibration')}{period}"
    )
    if document["model"]:
        say(f"model of each lot: {', '.join(document['model'])}", style="dim")
    for row in pooled["left_out"][:_SHOWN_OUT]:
        say(f"left out  {row['run']}: {row['reason']}", style="dim")
    if len(pooled["left_out"]) > _SHOWN_OUT:
        say(f"left out  {len(pooled['left_out']) - _SHOWN_OUT} more; --json has all", style="dim")
    say()
    if not document["discoveries"] and not document["unexplained"]:
        say("no discovery")
    for row in document["discoveries"]:
        say(headline(row), style="yellow" if row["id"] in document["new"] else "")
        say(f"    {scope_text(row)}")
    _beside(document)
    if control["log_e_needed"] is not None:
        say(
            f"a discovery needs a likelihood ratio of e^{short(control['log_e_needed'])}: where nothing is hidden, the "
            f"probability that one ever appears is at most {100.0 * control['alpha']:g} %, however often one looks",
            style="dim",
        )
    for text in document["warnings"]:
        say(text, style="yellow")
    rows = [*document["discoveries"], *document["unexplained"]]
    if rows and not document["looking_back"]:
        print_next([command_line("discover", *again, "--explain", rows[0]["id"])])
    if reach:
        _reach(document)


def _beside(document: DiscoverDocument) -> None:
    """Print what is no discovery: unexplained evidence, remainders of a model, evidence that may be wander of the station."""
    for found in document["unexplained"]:
        say(unexplained_text(found), style="yellow" if found["id"] in document["new"] else "")
    for comparison in document["compared"]:
        sizes = f"{short(comparison['size_ug_before'])} → {short(comparison['size_ug_after'])} µg"
        evidence = f"evidence e^{short(comparison['log_e_before'])} → e^{short(comparison['log_e_after'])}"
        say(
            f"{comparison['id']} with {comparison['recommended']} in every lot's model: {sizes}, {evidence}",
            style="green",
        )
    for finding in document["population"]:
        say(_of_population(finding), style="yellow")
    for row in document["held"][:_SHOWN_HELD]:
        axis = f" {row['axis']}" if row["axis"] else ""
        say(f"held back: {row['effect']}{axis} by {row['driver']}: {row['reason']}", style="dim")
    if len(document["held"]) > _SHOWN_HELD:
        say(f"held back: {len(document['held']) - _SHOWN_HELD} more; --json has all", style="dim")


def _of_population(finding: PopulationRow) -> str:
    detail = finding["detail"]
    if finding["kind"] == "correlation":
        value = f"{short(detail['correlation'])} ± {short(2.0 * detail['u'])}"
        return (
            f"{finding['figure']} and {detail['with']} of {detail['units']} units correlate by {value}, "
            "the errors of their fits taken out"
        )
    both = zip(detail["means"], detail["widths"], strict=True)
    means = " and ".join(f"{short(value)} ± {short(width)}" for value, width in both)
    share = f"{short(100.0 * detail['share'])} % are the first"
    return f"two populations in {finding['figure']} of {detail['units']} units: {means} {detail['unit']}; {share}"


def print_explained(row: DiscoveryRow | UnexplainedRow) -> None:
    """The screen of ``discover --explain``."""
    if "nearest" in row:
        say(unexplained_text(row))
        say(f"    of all effects {row['nearest']} has the largest evidence, and does not account for it")
        if row["map"]:
            say("next: look at its map (--output), and write an effect of your own")
        else:
            say("next: measure more lots; it has a name or a map once each half of the lots predicts the other")
        return
    say(headline(row))
    say(f"    {scope_text(row)}")
    others = [name for name in row["effects"] if name != row["recommended"]]
    if others:
        say(f"    the lots do not separate it from {', '.join(others)}")
    other_drivers = [name for name in row["drivers"] if name != row["driver"]]
    if other_drivers:
        say(f"    nor {row['driver']} from {', '.join(other_drivers)}")
    for text in support_text(row):
        say(f"    {text}")
    if row["kind"] == "levels":
        lines = [
            [level["level"], short(level["size_ug"]), short(level["u_ug"]), str(level["units"] or "")]
            for level in row["levels"]
        ]
        axis = f" on {row['levels'][0]['axis']}" if row["levels"] and row["levels"][0]["axis"] else ""
        print_table([row["driver"], f"size{axis}\nµg", "u\nµg", "units"], lines[:_SHOWN_LEVELS])
        if len(lines) > _SHOWN_LEVELS:
            say(f"{len(lines) - _SHOWN_LEVELS} more; --json and --output have them")
    say(f"next: {row['next']}")


def _reach(document: DiscoverDocument) -> None:
    """Print the smallest size of each effect that the archive would have shown."""
    if not document["reach"]:
        return  # the warnings say how many lots are needed
    rows: dict[str, dict[str, str]] = {}
    for row in document["reach"]:
        cells = rows.setdefault(row["effect"], {})
        cells[row["driver"]] = short(row["smallest_ug"])
        cells[f"{row['driver']} lots"] = str(row["lots_to_1_ug"] or "")
    keys = ("mean", "mean lots", "inside lots", "inside lots lots")
    lines = [[effect, *(cells.get(key, "") for key in keys)] for effect, cells in rows.items()][:_SHOWN_REACH]
    print_table(
        ["effect", "common\nto all\nµg", "lots\nto 1 µg", "inside\nlots\nµg", "lots\nto 1 µg"],
        lines,
        "smallest effect shown in 95 % of cases",
    )
    for row in document["unseen"]:
        say(f"never: {row['effect']}, because {row['reason']}", style="dim")
