"""``tumbleline station frames`` and ``replay``: a recording of links shown, made a test, and answering."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.options import JsonOption, argument, option
from pipelines.cli.printing import give, print_json, print_table, publish, remark, say
from schemas.errors import STATION, WrongUse

if TYPE_CHECKING:
    from pipelines.commissioning.documents import FramesDocument, RecordedDeviceRow

FrameFileArgument = Annotated[
    Path,
    argument("FILE", "A recording of --record or of a bring-up, a pcap or pcapng file, or a log of a Modbus tool."),
]
SHOWN = 200


def frames(
    file: FrameFileArgument,
    limit: Annotated[int, option("--limit", "Number of frames, the last ones.", min=1)] = 40,
    page: Annotated[Path | None, option("--page FILE", "Write the time line as a page (HTML).")] = None,
    as_test: Annotated[
        Path | None, option("--as-test FILE", "Write a test for pytest, with the recording beside it.")
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Show a recording of a station's links: every request with its time, meaning and answer.

    With --as-test a recorded defect becomes a test: it holds the client to what it gets from the recorded device.
    """
    from pipelines.commissioning.frames import as_test as text_of
    from pipelines.commissioning.frames import frames_document, frames_page
    from stations.recordings.other_programs import read_recording

    recording = read_recording(file)
    if page is not None:
        publish(page, frames_page(recording), "page")
    if as_test is not None:
        if as_test.suffix != ".py":
            raise WrongUse(f"frames: --as-test {as_test}, a file that ends in .py is needed; correct its name")
        beside = as_test.with_name(f"{as_test.stem}{file.suffix}")
        publish(beside, file.read_bytes(), "recording")
        publish(as_test, text_of(file, beside.name), "test")
    document = frames_document(recording, None if as_json else limit)
    give(document, partial(_print, len(recording.exchanges)), as_json=as_json)


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

    What was never asked while it was recorded is refused and named. Exit status 3: something new was asked.
    """
    import signal
    import threading

    from pipelines.commissioning.frames import devices_of
    from stations.recordings.other_programs import read_recording
    from stations.recordings.replay_server import ReplayServer

    recording, stop = read_recording(file), threading.Event()
    for name in (signal.SIGTERM, signal.SIGINT):
        signal.signal(name, lambda *_: stop.set())
    told = set[str]()

    def new(request: str) -> None:
        if request not in told:
            told.add(request)
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
    raise typer.Exit(STATION if told else 0)


def _print(total: int, document: FramesDocument) -> None:
    _print_devices(document["devices"], document["purpose"])
    lines = [
        [f"{f['at_s']:.3f}", f"{1e3 * f['seconds']:.1f}", f["place"], f["kind"], f["what"], f["answer"][:SHOWN]]
        for f in document["frames"]
    ]
    print_table(["time, s", "answer, ms", "device", "kind", "what", "answer"], lines)
    if total > len(lines):
        say(f"the last {len(lines)} of {total} frames; --limit shows more, --json all")
    if document["remark"]:
        remark(document["remark"])


def _print_devices(devices: list[RecordedDeviceRow], title: str) -> None:
    heads = ["device", "link", "id", "profile", "exchanges", "no answer"]
    lines = [
        [d["place"], d["link"], str(d["device_id"]), d["profile"] or "—", str(d["exchanges"]), str(d["no_answer"])]
        for d in devices
    ]
    print_table(heads, lines, title)
