"""An inquiry for people: what was measured beside the first run and why, what is known now, and what to do next."""

from __future__ import annotations

from typing import Any

from pipelines.cli.options import console, print_table, short


def print_inquiry(document: dict[str, Any]) -> None:
    """Print an inquiry."""
    from pipelines.cli.verdict import measurements_table, print_findings, verdict

    out = console()
    good = document["ended"] in {"adequate", "told_apart"}
    out.print(verdict(document), style="bold green" if document["adequate"] else "bold red", soft_wrap=True)
    _rounds(document)
    print_findings(document)
    out.print(
        f"{document['text'][:1].upper()}{document['text'][1:]}.", style="green" if good else "yellow", soft_wrap=True
    )
    if document["ended"] in {"asked", "declined"}:
        measurements_table(document["next_measurements"])
        out.print("\nNext:", style="bold")
        out.print(f"  {document['command']}", markup=False, soft_wrap=True)
    elif document["recommended"]:
        out.print("\nNext:", style="bold")
        for name in document["recommended"]:
            out.print(f"  tumbleline extend model.toml {name}", markup=False, soft_wrap=True)


def _rounds(document: dict[str, Any]) -> None:
    minutes = document["minutes"]
    first, further = short(minutes["first_run"]), short(minutes["follow_ups"]) or "0"
    text = (
        f"Station time: {first} min for the first run ({document['run']}), {further} min for follow-ups "
        f"({100.0 * minutes['share']:.0f} %), {short(minutes['budget'])} min were allowed."
    )
    console().print(text, markup=False, soft_wrap=True)
    if document["rounds"]:
        lines = [[r["run"], short(r["minutes"]), "\n".join(r["why"])] for r in document["rounds"]]
        print_table(["follow-up", "min", "why"], lines, title="What the station measured besides")
