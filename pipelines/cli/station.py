"""``tumbleline station``: bring-up, recordings, state, self-test, log, operator, health and programming of a station."""

import re
from typing import TYPE_CHECKING, Annotated, Any

from pipelines.archive import Archive
from pipelines.cli import options
from pipelines.cli.groups import group
from pipelines.cli.inputs import made_up
from pipelines.cli.options import Setting, argument, option, set_option, settings
from pipelines.cli.printing import give, print_json, print_table, say
from pipelines.cli.station_bring_up import bring_up, frames, replay
from pipelines.cli.station_check import check
from pipelines.cli.station_monitor import monitor
from pipelines.cli.station_operator import operator
from pipelines.cli.station_program import program
from pipelines.cli.station_watch import status, watch

if TYPE_CHECKING:
    from schemas.profile import Profile

PART = "Measure"
ORDER = 150
SUMMARY = "Connect, check, show, watch and serve stations; operator, health, programming of units."
EXAMPLES = ("tumbleline station status --station line-1.toml", "tumbleline station check --station line-1.toml")
EXAMPLES_OF = {
    "bring-up": (
        "tumbleline station bring-up watlow_f4t tcp://192.168.0.20 --read-only",
        "tumbleline station bring-up oriental_az serial:/dev/ttyUSB0 --device-id 1",
    ),
    "operator": ("tumbleline station operator", "tumbleline station operator line-six --answer go"),
    "monitor": (
        "tumbleline station monitor --queue line-1",
        "tumbleline station monitor --port 9464 --webhook https://alerts.example/hook --audits audits",
    ),
    "program": (
        "tumbleline station program latest --units SN1,SN2",
        "tumbleline station program latest --station line-1.toml --format q24 --yes",
    ),
    "frames": (
        "tumbleline station frames frames.jsonl",
        "tumbleline station frames frames.jsonl --output test_slow_chamber.py",
    ),
    "replay": (
        "tumbleline station replay frames.jsonl",
        "tumbleline station replay capture.pcapng --port 1502 --speed 10",
    ),
    "status": (
        "tumbleline station status --station line-1.toml",
        "tumbleline station status --station line-1.toml --every 2",
    ),
    "check": (
        "tumbleline station check --station line-1.toml",
        "tumbleline station check --station line-1.toml --read-only",
    ),
    "log": ("tumbleline station log", "tumbleline station log latest --all"),
    "watch": ("tumbleline station watch", "tumbleline station watch --station line-1.toml --last 30"),
    "serve": ("tumbleline station serve --port 5020", "tumbleline station serve --slots 4 --speed 60"),
    "profiles": ("tumbleline station profiles", "tumbleline station profiles watlow_f4t"),
}
"""Of the subcommands."""

STYLES = {
    "spoilt": "yellow",
    "suspended": "yellow",
    "resumed": "green",
    "unit_lost": "magenta",
    "power": "yellow",
    "fails": "red",
    "known": "green",
    "given_up": "yellow",
    "emergency_stop": "bold red",
    "stopped": "red",
    "not_safe": "bold red",
    "watchdog_acts": "yellow",
    "watchdog_failed": "bold red",
    "watchdog_lost": "yellow",
    "lease_lost": "bold red",
}
QUIET = {"reference", "soak", "look"}  # shown only with --all, because they occur in every run


def log(
    run: Annotated[str, argument("[RUN]", "Show only this run of the archive.")] = "",
    archive: options.ArchiveOption = None,
    last: Annotated[int, option("--last N", "Number of events, newest last.", min=1)] = 50,
    *,
    everything: Annotated[bool, option("--all", "Also show soaks and reference readings.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Show events that paused or ended runs (from the archive) and events of stations (from the log of this computer)."""
    store = Archive(archive)
    store.refuse_misnamed(archive)
    recorded = [*_of_runs(store, run), *([] if run else _of_machine())]
    events = [event for event in recorded if everything or event["kind"] not in QUIET]
    events = sorted(events, key=lambda event: event["when"])[-last:]
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
    for stored in runs:
        captures.setdefault(str(stored.about.get("capture") or ""), stored.id)
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


SHORT = {"read": "r", "write": "w", "read_write": "rw"}
SETTINGS = re.compile(r"[,:;(]| with | behind ")
"""Words between the name of a model and the required settings of the device."""


SERVING = {
    "silence": Setting(
        "S", "seconds without a request after which drives and reader stop, 30 by default; 0: never", float, 0.0
    )
}


def serve(
    station: options.StationOption = None,
    host: Annotated[str, option("--host", "Interface to listen on.")] = "127.0.0.1",
    port: Annotated[
        int, option("--port", "First TCP port; each text protocol needs the next; 0: any.", min=0, max=65535)
    ] = 5020,
    speed: Annotated[
        float, option("--speed", "Simulated seconds per second of real time.", min=0.001, max=1000.0)
    ] = 1.0,
    device: options.SimulatedDeviceOption = "ADXL355",
    units: options.SimulatedUnitsOption = 8,
    seed: Annotated[int, option("--seed", "Random seed of the simulated units.", min=0)] = 1,
    setting: Annotated[list[str] | None, set_option(SERVING)] = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Serve the simulated station over Modbus TCP until interrupted, for any Modbus client."""
    from pipelines.cli.terminal import stopped
    from schemas.station import load_station
    from stations.serving import serve as run
    from stations.serving import served

    config = load_station(station)

    def ready(at: str, port_found: int) -> None:
        devices = served(config, list(range(units)))
        rows = [{"name": d.name, "device_id": d.device_id, "profile": d.profile} for d in devices]
        if as_json:
            print_json({"host": at, "port": port_found, "devices": rows})
            return
        title = f"{config.name} on {at}:{port_found}, speed {speed:g}"
        print_table(["device", "id", "profile"], [[d.name, str(d.device_id), d.profile] for d in devices], title)
        say("stop with Ctrl-C")

    silence_s = settings(setting, SERVING, "serve").get("silence", 30.0)
    lot = made_up(device, units, seed)
    run(config, lot, host=host, port=port, speed=speed, stop=stopped(), ready=ready, silence_s=silence_s)


def profiles(
    name: Annotated[str, argument("[PROFILE]", "Show the registers of this profile.")] = "",
    *,
    as_json: options.JsonOption = False,
) -> None:
    """List the register-map profiles, or the registers of one profile."""
    from stations.profile_files import load_profile, profile_names

    if name:
        profile = load_profile(name)
        give(profile.model_dump(mode="json"), lambda _: _print_profile(profile), as_json=as_json)
        return
    loaded = [load_profile(profile_name) for profile_name in profile_names()]
    heads = ["profile", "kind", "device", "links", "verified"]
    lines = [
        [
            p.name,
            p.kind,
            f"{p.maker} {SETTINGS.split(p.model)[0].strip()}",
            " ".join(p.links),
            "yes" if p.verified else "no",
        ]
        for p in loaded
    ]
    rows = [p.model_dump(mode="json", exclude={"registers", "commands", "groups", "fifo"}) for p in loaded]
    give({"profiles": rows}, lambda _: print_table(heads, lines), as_json=as_json)


def _print_profile(profile: "Profile") -> None:
    """The registers or commands of a profile; registers on which sources disagree, one line each."""
    if profile.commands:
        lines = [[c.name, c.ask, c.tell, c.unit, c.disputed] for c in profile.commands]
        print_table(["value", "read command", "write command", "unit", "disputed"], lines, title=profile.model)
        return
    lines = [[r.name, r.space, str(r.address), r.type, SHORT[r.access], r.unit, r.manual] for r in profile.registers]
    print_table(["register", "space", "address", "type", "access", "unit", "manual"], lines, title=profile.model)
    for register in profile.registers:
        if register.disputed:
            say(f"disputed  {register.name}: {register.disputed}")


app = group(
    SUMMARY,
    {
        "bring-up": bring_up, "status": status, "check": check, "watch": watch, "log": log, "operator": operator,
        "monitor": monitor, "program": program, "frames": frames, "replay": replay, "serve": serve, "profiles": profiles,
    },
)  # fmt: skip
