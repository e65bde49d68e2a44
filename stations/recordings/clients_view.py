"""What this product's client gets from a recorded device, so that a recorded defect becomes a test."""

from dataclasses import replace
from pathlib import Path

from schemas.station_devices import Carried
from stations.links.frames import Malformed
from stations.links.making import lines_to, wire_to
from stations.links.wires import Broken, LineWire, Silence, Wire
from stations.recordings.decoding import said
from stations.recordings.frame_file import SILENCE, Exchange, FrameFile
from stations.recordings.other_programs import read_recording
from stations.recordings.replay_server import ReplayServer

PATIENCE_S = 5.0
SILENT_S = 0.2
FAST = 1000.0
_ANY = Carried(profile="recorded")


def what_a_client_gets(path: Path) -> list[str]:
    """One line for each recorded exchange: what the client reads when the device answers as it did.

    The device is served on loopback, and asked in the recorded order over a real connection; delays are shortened.
    """
    recording = read_recording(path)
    wires: dict[str, Wire] = {}
    lines: dict[str, LineWire] = {}
    with ReplayServer(recording, speed=FAST) as server:
        try:
            return [_seen(recording, exchange, server, wires, lines) for exchange in recording.exchanges]
        finally:
            for wire in (*wires.values(), *lines.values()):
                wire.close()


def _seen(
    recording: FrameFile, exchange: Exchange, server: ReplayServer, wires: dict[str, Wire], lines: dict[str, LineWire]
) -> str:
    patience = SILENT_S if exchange.failed == SILENCE else PATIENCE_S
    reply: bytes | None = None
    try:
        if exchange.text:
            line = lines.get(exchange.link) or lines_to(_ANY, server.host, server.lines_at[exchange.link], patience)
            lines[exchange.link] = line
            line.timeout_s = patience
            reply = line.exchange(exchange.request.decode("ascii"), exchange.what).encode()
        else:
            wire = wires.get(exchange.link) or wire_to(_ANY, server.host, server.port, patience)
            wires[exchange.link] = wire
            wire.timeout_s = patience
            reply = wire.exchange(exchange.device_id, exchange.request)
        failed = ""
    except Silence:
        failed = SILENCE
    except (Broken, Malformed) as problem:
        failed = f"{type(problem).__name__.lower()}"
    got = replace(exchange, seconds=0.0, reply=reply, failed=failed)
    return f"{recording.name_of(exchange)}: {exchange.what} -> {said(got, recording.device_of(exchange))}"
