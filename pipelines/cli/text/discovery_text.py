"""Discoveries for people: what differs by what, how large it is, why it is beyond chance, and what to do next."""

from __future__ import annotations

from typing import Any

from inertial.counts import number_of
from pipelines.cli.printing import print_table, say, short
from pipelines.discovery.documents import DiscoverDocument, DiscoveryDemo, DiscoveryRow
from pipelines.discovery.figures_of_name import headline, scope_text

_SHOWN_HELD, _SHOWN_LEVELS, _SHOWN_OUT, _SHOWN_REACH = 3, 12, 3, 40


def print_discoveries(document: DiscoverDocument, *, reach: bool = False) -> None:
    """The screen of ``discover``; with ``reach`` also what the archive could have shown."""
    pooled, control = document["pooled"], document["error_control"]
    period = f", {pooled['from']} to {pooled['until']}" if pooled["from"] else ""
    say(
        f"{number_of(pooled['lots'], 'lot')} of {document['device']}, {number_of(pooled['units'], 'unit calibration')}{period}"
    )
    say(f"model of each lot: {', '.join(document['model'])}", style="dim")
    for row in pooled["left_out"][:_SHOWN_OUT]:
        say(f"left out  {row['run']}: {row['reason']}", style="dim")
    if len(pooled["left_out"]) > _SHOWN_OUT:
        say(f"left out  {len(pooled['left_out']) - _SHOWN_OUT} more; --json has all", style="dim")
    say()
    if not document["discoveries"]:
        say("no discovery")
    for row in document["discoveries"]:
        say(headline(row), style="yellow" if row["id"] in document["new"] else "")
        say(f"    {scope_text(row)}")
    _beside(document)
    say(
        f"a discovery needs evidence of e^{short(control['log_e_needed'])}: where nothing is hidden, the probability that one "
        f"ever appears is at most {100.0 * control['alpha']:g} %, however often it is looked at",
        style="dim",
    )
    for text in document["warnings"]:
        say(text, style="yellow")
    if document["discoveries"] and not document["looking_back"]:
        say(f"\nNext\n  tumbleline discover --explain {document['discoveries'][0]['id']}")
    if reach:
        _reach(document)


def _beside(document: DiscoverDocument) -> None:
    """What is no discovery: unexplained evidence, what a model leaves, what may be the station's own wander."""
    for found in document["unexplained"]:
        text = f"unexplained: something differs by {found['driver']}, and no effect of the catalogue accounts for it"
        say(text, style="yellow")
    for one in document["compared"]:
        sizes = f"{short(one['size_ug_before'])} → {short(one['size_ug_after'])} µg"
        evidence = f"evidence e^{short(one['log_e_before'])} → e^{short(one['log_e_after'])}"
        say(f"{one['id']} with {one['recommended']} in every lot's model: {sizes}, {evidence}", style="green")
    for kind in document["population"]:
        detail = kind["detail"]
        both = zip(detail["means"], detail["widths"], strict=True)
        means = " and ".join(f"{short(value)} ± {short(width)}" for value, width in both)
        share = f"{short(100.0 * detail['share'])} % are the first"
        say(
            f"two populations in {kind['figure']} of {detail['units']} units: {means} {detail['unit']}; {share}",
            style="yellow",
        )
    for row in document["held"][:_SHOWN_HELD]:
        axis = f" {row['axis']}" if row["axis"] else ""
        say(f"held back: {row['effect']}{axis} by {row['driver']}: {row['reason']}", style="dim")
    if len(document["held"]) > _SHOWN_HELD:
        say(f"held back: {len(document['held']) - _SHOWN_HELD} more; --json has all", style="dim")


def print_explained(row: DiscoveryRow) -> None:
    """The screen of ``discover --explain``."""
    say(headline(row))
    say(f"    {scope_text(row)}")
    others = [name for name in row["effects"] if name != row["recommended"]]
    if others:
        say(f"    the lots do not tell it from {', '.join(others)}")
    other_drivers = [name for name in row["drivers"] if name != row["driver"]]
    if other_drivers:
        say(f"    nor its driver from {', '.join(other_drivers)}")
    carried = row["carried_by"]
    if carried["lots_for"] is not None:
        less = short(carried["log_e_without_largest_2_percent"])
        say(
            f"    {short(100.0 * carried['lots_for'])} % of the lots speak for it; e^{less} without the 2 % that speak most"
        )
    if row["confirmed"] is None:
        say("    fewer than 20 lots came since; later ones will confirm it or not")
    else:
        say(f"    later lots {'show' if row['confirmed'] else 'do not show'} what earlier ones predict")
    if row["kind"] == "levels":
        lines = [
            [one["level"], short(one["size_ug"]), short(one["u_ug"]), str(one["units"] or "")] for one in row["levels"]
        ]
        print_table([row["driver"], "size\nµg", "u\nµg", "units"], lines[:_SHOWN_LEVELS])
        if len(lines) > _SHOWN_LEVELS:
            say(f"{len(lines) - _SHOWN_LEVELS} more; --json and --html have them")
    say(f"next: {row['next']}")


def _reach(document: DiscoverDocument) -> None:
    """What the archive could have shown, by effect."""
    if not document["reach"]:
        return  # the warnings say how many lots are needed
    rows: dict[str, dict[str, str]] = {}
    for row in document["reach"]:
        own = rows.setdefault(row["effect"], {})
        own[row["driver"]] = short(row["smallest_ug"])
        own[f"{row['driver']} lots"] = str(row["lots_to_1_ug"] or "")
    keys = ("mean", "mean lots", "inside lots", "inside lots lots")
    lines = [[effect, *(own.get(key, "") for key in keys)] for effect, own in rows.items()][:_SHOWN_REACH]
    print_table(
        ["effect", "common\nto all\nµg", "lots\nto 1 µg", "inside\nlots\nµg", "lots\nto 1 µg"],
        lines,
        "smallest effect shown in 95 % of cases",
    )
    for row in document["unseen"]:
        say(f"never: {row['effect']}, because {row['reason']}", style="dim")


def print_ending(document: dict[str, Any]) -> None:
    """Print what was hidden, and what was found of it."""
    hidden = document["hidden"]
    say(f"{hidden['physics']} ({hidden['kind']}): {hidden['effect']}", style="bold")
    named = ", ".join(" or ".join(group) for group in document["classes"]) or "nothing"
    if document["told_apart"]:
        say(f"The diagnosis named {named}. Found.", style="bold green")
    elif document["found"]:
        _print_class(document, named)
    elif hidden["effect"] in document["unseen"]:
        text = f"The diagnosis named {named}, and listed {hidden['effect']} as not visible under this plan."
        say(text, style="bold yellow")
    else:
        say(f"The diagnosis named {named}. Not found.", style="bold red")
    lines = [
        [text, *(short(document[key][name]) for name in ("rms_ug", "fresh_rms_ug"))]
        for text, key in (("before", "before"), ("extended", "after"))
    ]
    print_table(["model", "residual, µg", "fresh run, µg"], lines)
    say(f"Everything is in {document['folder']}: dwells, model.toml and report.html.")


def _print_class(document: dict[str, Any], named: str) -> None:
    """Print the result if the hidden effect is in a class with others, and the measurement that separates them."""
    from pipelines.cli.text.diagnosis_text import print_next_measurement

    group = next(group for group in document["not_told_apart"] if document["hidden"]["effect"] in group)
    added = [name for name in document["added"] if name in group]
    others = ", ".join(name for name in group if name not in added)
    one = f"the added effect, {' and '.join(added)}, is one of a class" if added else "nothing of its class was added"
    text = f"The diagnosis named {named}. Found in a class, not separated: {one}; these data fit equally well with {others}."
    say(text, style="bold yellow")
    rows = [row for row in document["next_measurements"] if set(row["why"].split(":")[0].split(" | ")) & set(group)]
    if not rows:
        say("No measurement that the station can take is certain to separate them.")
    elif "minutes" in rows[0]:
        say("The measurement that separates them:")
        print_next_measurement(rows)
    else:
        say(rows[0]["why"])


def print_discovery_demo(document: DiscoveryDemo) -> None:
    """Print the story of an archive: which night something was found, what it is, and what adding it does."""
    from pipelines.cli.next_commands import command_line, print_next
    from pipelines.discovery.figures_of_name import headline, scope_text

    archive = f"{document['folder']}/archive"
    say(
        f"{document['lots']} lots were measured on three stations. Each lot passes its own check; something is hidden in one of "
        "twelve wafers."
    )
    say("\n1. What do the lots show together?", style="bold cyan")
    if not document["discoveries"]:
        say("nothing beyond chance; more lots would show it", style="yellow")
    for row in document["discoveries"]:
        say(headline(row))
        say(f"    {scope_text(row)}")
    if document["compared"]:
        say("\n2. The effect is added to the model of every lot.", style="bold cyan")
    for one in document["compared"]:
        confirmed = next(row["confirmed"] for row in document["discoveries"] if row["id"] == one["id"])
        later = "too few lots came since"
        if confirmed is not None:
            later = f"lots after that night {'confirm' if confirmed else 'do not confirm'} it"
        say(
            f"{one['id']}: {short(one['size_ug_before'])} → {short(one['size_ug_after'])} µg, evidence "
            f"e^{short(one['log_e_before'])} → e^{short(one['log_e_after'])}; {later}"
        )
    hidden = document["hidden"]
    say("\n3. What was hidden?", style="bold cyan")
    right = document["found"] and document["wafer_named"]
    say(
        f"{hidden['physics']} in wafer {hidden['wafer']} ({hidden['effect']}). {'Found.' if right else 'Not found.'}",
        style="bold green" if right else "bold red",
    )
    print_next([command_line("discover", "--archive", archive, "--html", f"{document['folder']}/discoveries.html")])
