"""``tumbleline station log``: events that paused or ended runs, and events of stations, in order of time."""

from __future__ import annotations

from typing import Annotated, Any

from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import give, say

STYLES = {
    "spoilt": "yellow",
    "suspended": "yellow",
    "resumed": "green",
    "unit_lost": "magenta",
    "power": "yellow",
    "emergency_stop": "bold red",
    "stopped": "red",
    "not_safe": "bold red",
    "watchdog_acts": "yellow",
    "watchdog_failed": "bold red",
    "watchdog_lost": "yellow",
    "lease_lost": "bold red",
}
QUIET = {"reference", "soak"}  # shown only with --all, because they occur in every run


def log(
    run: Annotated[str, argument("[RUN]", "Show only this run of the archive.")] = "",
    archive: ArchiveOption = None,
    limit: Annotated[int, option("--limit", "Number of events, newest last.", min=1)] = 50,
    *,
    everything: Annotated[bool, option("--all", "Also show soaks and reference readings.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show events that paused or ended runs (from the archive) and events of stations (from the log of this computer)."""
    recorded = [*_of_runs(Archive(archive), run), *([] if run else _of_machine())]
    events = [event for event in recorded if everything or event["kind"] not in QUIET]
    events = sorted(events, key=lambda event: event["when"])[-limit:]
    give({"events": events}, _print, as_json=as_json)


def _print(document: dict[str, Any]) -> None:
    """Every event as text: time, place and kind; below it the cause and the action."""
    from rich.padding import Padding
    from rich.text import Text

    for event in document["events"]:
        record = f", record {event['record']}" if event.get("record", -1) >= 0 else ""
        head = Text.assemble(
            (event["when"][:19].replace("T", " "), "dim"),
            f"  {event['where']}{record}  ",
            (event["kind"].replace("_", " "), STYLES.get(event["kind"], "")),
        )
        say(head)
        cause_and_action = " → ".join(part for part in (event["reason"], event["action"]) if part)
        if cause_and_action:
            say(Padding(Text(cause_and_action), (0, 0, 0, 4)))
    if not document["events"]:
        say("no events")


def _of_runs(store: Archive, run: str) -> list[dict[str, Any]]:
    """Events of the captures of the archive, each once, under the name of the first run that used it."""
    runs = [store.run(run)] if run else [store.run(info.id) for info in store.runs()]
    captures: dict[str, str] = {}
    for one in runs:
        captures.setdefault(str(one.about.get("capture") or ""), one.id)
    return [
        {"where": run_id, **event}
        for capture, run_id in captures.items()
        if capture
        for event in store.capture(capture).events.documents()
    ]


def _of_machine() -> list[dict[str, Any]]:
    """Events of stations on this computer: motion, safe state after a run, safe state by a watchdog."""
    from stations.safety.folder import read_log as machine_log
    from stations.safety.folder import state_folder

    known = {"when", "station", "event", "why", "what"}
    return [
        {
            "when": line["when"],
            "where": line["station"],
            "kind": line["event"],
            "reason": line.get("why", ""),
            "action": line.get("what") or ", ".join(f"{k} {v}" for k, v in line.items() if k not in known),
        }
        for line in machine_log(state_folder())
    ]
