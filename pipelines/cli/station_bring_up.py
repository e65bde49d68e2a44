"""``tumbleline station bring-up``, ``frames`` and ``replay``: the first hour with one real device, and recordings of links."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from pipelines.cli.options import PAGES, JsonOption, Setting, argument, option, outputs, set_option, settings
from pipelines.cli.printing import give, print_json, print_table, publish, remark, say
from schemas.errors import STATION, StationError, WrongUse

if TYPE_CHECKING:
    from pipelines.commissioning.documents import ConformanceDocument, FramesDocument, RecordedDeviceRow
    from stations.bringup.session import BringUp

ON = "What is at the other end: hardware, simulator or replay? (Enter: not stated)"


SECONDS = {
    "timeout": Setting("S", "longest answer, 2 s by default", float, 0.05, 60.0),
    "silence": Setting("S", "how long the link is cut in that step, 40 s by default", float, 1.0, 600.0),
    "watch": Setting("S", "how long the air of a chamber is watched, 20 s by default", float, 0.0, 3600.0),
}


def bring_up(
    profile: Annotated[
        str, argument("PROFILE", "The profile of the device; 'tumbleline station profiles' lists them.")
    ],
    link: Annotated[str, argument("LINK", "tcp://HOST[:PORT], serial:DEVICE[,BAUD[,PARITY[,STOP]]] or visa:RESOURCE.")],
    device_id: Annotated[int, option("--device-id", "Unit id of the device; 0: look for it.", min=0, max=255)] = 0,
    out: Annotated[Path | None, option("--output -o DIR", "New folder for page, recording and profile.")] = None,
    setting: Annotated[list[str] | None, set_option(SECONDS)] = None,
    who: Annotated[str, option("--who NAME", "Name of the person, for the page.")] = "",
    *,
    readings: Annotated[bool, option("--read-only", "Only read: nothing is moved or set.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Connect one real device step by step; report each register and behaviour of its profile as held, different or not tried.

    First it only reads: it looks for the device, its word order and its registers, and asks what the panel shows. Each order is
    given only after the word for it is typed. Whatever ends it, Ctrl-C and kill included, the device is left as it was found.
    Exit status 3: something differs, or nothing answers.
    """
    from stations.bringup.session import BringUp
    from stations.bringup.target import device_at
    from stations.links.recorder import recorded
    from stations.profile_files import load_profile

    seconds = settings(setting, SECONDS, "bring-up")
    loaded = load_profile(profile)
    device = device_at(link, loaded, device_id or 1)
    folder = _new_folder(out, loaded.name)
    person = _Typed()
    search = link.startswith("serial:") and "," not in link
    with recorded(folder / "frames.jsonl", f"bring-up of {loaded.name}"):
        session = BringUp(
            loaded,
            device,
            person,
            device_id,
            search,
            orders=not readings,
            timeout_s=seconds.get("timeout", 2.0),
            silence_s=seconds.get("silence", 40.0),
            watch_s=seconds.get("watch", 20.0),
        )
        try:
            session.run()
        except (StationError, KeyboardInterrupt):
            _written(session, folder, person, who, as_json=as_json)
            raise
    document = _written(session, folder, person, who, as_json=as_json)
    raise typer.Exit(STATION if document["differs"] else 0)


def _new_folder(out: Path | None, profile: str) -> Path:
    folder = out or Path(f"bring-up-{profile}-{datetime.now(UTC):%Y%m%d-%H%M%S}")
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise WrongUse(f"bring-up: {folder} is there already, a new folder is needed; give another --output") from None
    except OSError as problem:
        raise WrongUse(f"bring-up: {folder} cannot be made ({problem.strerror}); give another --output") from None
    return folder


def _written(session: BringUp, folder: Path, person: _Typed, by: str, *, as_json: bool) -> ConformanceDocument:
    """Writes page, document and corrected profile, and prints the result."""
    import json

    from pipelines.commissioning.conformance import conformance_page, document_of
    from pipelines.commissioning.documents import Platform
    from pipelines.tables.json_values import json_value
    from stations.bringup.corrected import corrected_name, corrected_text

    corrected = corrected_text(session.profile, session.findings, session.made)
    name = f"{corrected_name(session.profile)}.toml" if corrected else ""
    typed = "" if session.ended else person.ask(ON).strip().lower()
    platform: Platform = next((known for known in get_args(Platform) if known == typed), "not stated")
    document = document_of(session, verified_on=platform, by=by, recording="frames.jsonl", corrected=name)
    if corrected:
        publish(folder / name, corrected, "corrected profile")
    text = json.dumps(json_value(document), ensure_ascii=False, indent=2)
    publish(folder / "conformance.json", f"{text}\n", "conformance")
    publish(folder / "conformance.html", conformance_page(document, folder / "frames.jsonl"), "page")
    if as_json:
        print_json(document)
    else:
        _print(document)
    return document


def _print(document: ConformanceDocument) -> None:
    points = document["points"]
    if lines := [[p.what, p.found, p.expected, p.remedy] for p in points if p.verdict == "differs"]:
        print_table(["differs", "found", "expected", "what to do"], lines)
    untried = [p.what for p in points if p.verdict == "not tried" and p.part != "register"]
    if untried:
        say(f"not tried: {', '.join(untried)}")
    state = "" if document["complete"] else "; it ended before its last step"
    say(
        f"{document['profile']}: {document['held']} held, {document['differs']} differ, {document['not_tried']} not tried{state}"
    )


class _Typed:
    """The person at the terminal, or lines on standard input; its end skips every further question."""

    def tell(self, text: str) -> None:
        """Shows a line on standard error."""
        remark(text)

    def ask(self, question: str) -> str:
        """A line of standard input."""
        remark(f"{question} ", style="bold", end="")
        line = sys.stdin.readline()
        if not line.endswith("\n") or not sys.stdin.isatty():
            remark("")
        return line.rstrip("\n")


FrameFileArgument = Annotated[
    Path,
    argument("FILE", "A recording of --record or of a bring-up, a pcap or pcapng file, or a log of a Modbus tool."),
]
SHOWN = 200


def frames(
    file: FrameFileArgument,
    last: Annotated[int, option("--last N", "Number of frames, the last ones.", min=1)] = 40,
    output: Annotated[
        list[Path] | None,
        option(
            "--output -o FILE",
            "The time line as a page (.html), or a test for pytest (.py) with the recording beside it; may be repeated.",
        ),
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Show a recording of a station's links: every request with its time, meaning and answer.

    With --output FILE.py a recorded defect becomes a test: the test answers as the recorded device did.
    """
    from pipelines.commissioning.frames import as_test as text_of
    from pipelines.commissioning.frames import frames_document, frames_page
    from stations.recordings.other_programs import read_recording

    files = outputs(output, {"page": PAGES, "test": (".py",)}, "frames")
    page, as_test = files.get("page"), files.get("test")
    recording = read_recording(file)
    if page is not None:
        publish(page, frames_page(recording), "page")
    if as_test is not None:
        beside = as_test.with_name(f"{as_test.stem}{file.suffix}")
        publish(beside, file.read_bytes(), "recording")
        publish(as_test, text_of(file, beside.name), "test")
    document = frames_document(recording, None if as_json else last)
    give(document, partial(_print_frames, len(recording.exchanges)), as_json=as_json)


def replay(
    file: FrameFileArgument,
    host: Annotated[str, option("--host", "Interface to listen on.")] = "127.0.0.1",
    port: Annotated[int, option("--port", "TCP port; 0: any free port.", min=0, max=65535)] = 5020,
    speed: Annotated[
        float, option("--speed", "Recorded seconds per second: answers come sooner above 1.", min=0.001, max=1e6)
    ] = 1.0,
    *,
    as_json: JsonOption = False,
) -> None:
    """Answer as the recorded devices did, over Modbus TCP, until interrupted: same values, delays, exceptions and silences.

    A request that the recording does not contain is refused and printed. Exit status 3: there was one.
    """
    from pipelines.cli.terminal import stopped
    from pipelines.commissioning.frames import devices_of
    from stations.recordings.other_programs import read_recording
    from stations.recordings.replay_server import ReplayServer

    recording, stop, reported = read_recording(file), stopped(), set[str]()

    def new(request: str) -> None:
        if request not in reported:
            reported.add(request)
            remark(f"asked something new: {request}", style="yellow")

    with ReplayServer(recording, host, port, speed, new) as server:
        if as_json:
            print_json({"host": host, "port": server.port, "lines": server.lines_at, "devices": devices_of(recording)})
        else:
            _print_devices(devices_of(recording), f"{recording.name} on {host}:{server.port}")
            for link, at in server.lines_at.items():
                say(f"{link} answers lines on {host}:{at}")
            say("stop with Ctrl-C")
        stop.wait()
        answered = server.replay.answered
    remark(f"{answered} requests answered, {len(server.replay.asked_anew)} new")
    raise typer.Exit(STATION if reported else 0)


def _print_frames(total: int, document: FramesDocument) -> None:
    _print_devices(document["devices"], document["purpose"])
    lines = [
        [f"{f['at_s']:.3f}", f"{1e3 * f['seconds']:.1f}", f["place"], f["kind"], f["what"], f["answer"][:SHOWN]]
        for f in document["frames"]
    ]
    print_table(["time, s", "answer, ms", "device", "kind", "what", "answer"], lines)
    if total > len(lines):
        say(f"the last {len(lines)} of {total} frames; --last shows more, --json all")
    if document["remark"]:
        remark(document["remark"])


def _print_devices(devices: list[RecordedDeviceRow], title: str) -> None:
    heads = ["device", "link", "id", "profile", "exchanges", "no answer"]
    lines = [
        [d["place"], d["link"], str(d["device_id"]), d["profile"] or "—", str(d["exchanges"]), str(d["no_answer"])]
        for d in devices
    ]
    print_table(heads, lines, title)
