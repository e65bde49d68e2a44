"""The end of a demonstration for people: what was hidden, what was found of it, and what an archive of many lots shows."""

from typing import Any

from pipelines.cli.printing import print_table, say, short
from pipelines.discovery.documents import DiscoveryDemo


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
    found = f"the added effect, {' and '.join(added)}, is one of a class" if added else "nothing of its class was added"
    text = f"The diagnosis named {named}. Found in a class, not separated: {found}; these data fit equally well with {others}."
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
    from pipelines.discovery.sentences import headline, scope_text

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
    for comparison in document["compared"]:
        confirmed = next(row["confirmed"] for row in document["discoveries"] if row["id"] == comparison["id"])
        later = "too few lots were measured since it was found"
        if confirmed is not None:
            later = f"lots after that night {'confirm' if confirmed else 'do not confirm'} it"
        say(
            f"{comparison['id']}: {short(comparison['size_ug_before'])} → {short(comparison['size_ug_after'])} µg, evidence "
            f"e^{short(comparison['log_e_before'])} → e^{short(comparison['log_e_after'])}; {later}"
        )
    hidden = document["hidden"]
    say(f"\n{3 if document['compared'] else 2}. What was hidden?", style="bold cyan")
    right = document["found"] and document["wafer_named"]
    say(
        f"{hidden['physics']} in wafer {hidden['wafer']} ({hidden['effect']}). {'Found.' if right else 'Not found.'}",
        style="bold green" if right else "bold red",
    )
    print_next([command_line("discover", "--archive", archive, "--output", f"{document['folder']}/discoveries.html")])
