"""Recordings of other programs: Modbus TCP in pcap and pcapng, and logs of Modbus tools with frames as hexadecimal bytes.

They have no profiles: a device is known by its address and id, a register by its number.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from schemas.errors import DataRejected
from schemas.foreign import foreign
from schemas.library import library
from stations.links.frames import EXCEPTION, READ, WRITES, crc16
from stations.links.recorder import FORMAT, meaning
from stations.links.wires import HEADER, LONGEST
from stations.recordings.frame_file import SILENCE, Exchange, FrameFile, RecordedDevice, read_frames, readable

PCAP = (b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d")
PCAPNG = b"\x0a\x0d\x0d\x0a"
KNOWN = {*READ.values(), *WRITES, 6, 22, 23}
FEWEST_BYTES = 4
MOST_EARLY = 64
SENT = re.compile(r"(?<![a-z])(tx|sent|send|request|req|query|->|>>|out)(?![a-z])", re.IGNORECASE)
RECEIVED = re.compile(r"(?<![a-z])(rx|received|recv|response|resp|reply|<-|<<|in)(?![a-z])", re.IGNORECASE)
BYTES = re.compile(r"(?:(?<=[\s,;:>\-\[\"])|^)((?:(?:0x)?[0-9A-Fa-f]{2}[ \-:,]?){4,})(?:[\s\]\";]|$)")
CLOCK = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})(?:[.,:](\d{1,6}))?")
SECONDS = re.compile(r"^\s*\"?(\d+\.\d+)\"?\s*[,;\t ]")


def read_recording(path: Path) -> FrameFile:
    """A recording of this program, a pcap or pcapng file, or a log of a Modbus tool, recognised by its content.

    Raises DataRejected: it is none of these, or it holds no Modbus request.
    """
    with readable(path), path.open("rb") as file:
        head = file.read(256)
    if head.startswith(PCAP) or head.startswith(PCAPNG):
        exchanges, kind = list(_of_packets(path)), "Modbus TCP in a packet capture"
    elif FORMAT.encode() in head:
        return read_frames(path)
    else:
        exchanges, kind = list(_of_log(path)), "a log of a Modbus tool"
    if not exchanges:
        raise DataRejected(
            f"recording: {path} has no Modbus request; a file of '--record', a pcap or pcapng file with Modbus TCP, or a log "
            "with lines of Tx and Rx and the bytes of whole frames is needed"
        )
    who = dict.fromkeys((e.link, e.device_id) for e in exchanges)
    devices = [RecordedDevice(link, number, f"{link} device {number}") for link, number in who]
    return FrameFile(path.name, purpose=kind, devices=devices, items=list(exchanges))


@dataclass
class _Stream:
    """One direction of a TCP connection: its bytes in order, without repeated bytes."""

    first: int | None = None
    next: int = 0
    data: bytes = b""
    early: dict[int, bytes] = field(default_factory=dict[int, bytes])

    def add(self, number: int, data: bytes) -> None:
        """Adds a segment; an early segment waits for those before it, but not for ever: a capture may have lost them."""
        self.first = number if self.first is None else self.first
        at = (number - self.first) % 2**32
        if at > 2**31:  # repeated from before the capture
            return
        self.early[at] = max(data, self.early.get(at, b""), key=len)
        if len(self.early) > MOST_EARLY:
            self.next, self.data = min(self.early), b""
        while (fits := min(self.early, default=self.next + 1)) <= self.next:
            piece = self.early.pop(fits)
            self.data += piece[self.next - fits :]
            self.next = max(self.next, fits + len(piece))

    def frames(self) -> Iterator[bytes]:
        """The whole frames of Modbus TCP that have come; anything else ends the stream."""
        while len(self.data) >= HEADER:
            length = int.from_bytes(self.data[4:6], "big")
            if self.data[2:4] != b"\0\0" or not 2 <= length <= LONGEST:
                self.data = b""
                return
            if len(self.data) < 6 + length:
                return
            frame, self.data = self.data[: 6 + length], self.data[6 + length :]
            yield frame


@dataclass
class _Pending:
    at: float
    link: str
    device_id: int
    data: bytes

    def exchange(self, zero: float, when: float, reply: bytes | None) -> Exchange:
        """With its answer at a time, or without an answer; ``zero`` is the beginning of the recording, s."""
        failed = "" if reply is not None else SILENCE
        at, seconds, what = self.at - zero, when - self.at, meaning(self.data, ())
        return Exchange(at, seconds, self.link, self.device_id, what, self.data, reply, failed)


def _of_packets(path: Path) -> Iterator[Exchange]:
    """The exchanges in a packet capture, in order of their requests."""
    dpkt = library("dpkt", "captures", f"recording: {path.name} is a packet capture")
    streams: dict[tuple[bytes, int, bytes, int], _Stream] = {}
    waiting: dict[tuple[Any, ...], _Pending] = {}
    found: list[Exchange] = []
    zero: float | None = None
    with path.open("rb") as file:
        with foreign(f"recording: {path.name}", "a whole pcap or pcapng file is needed; record it again"):
            reader = library("dpkt.pcap", "captures", f"recording: {path.name}").UniversalReader(file)
            packets: Iterator[tuple[float, bytes]] = iter(reader)
            link_type = int(reader.datalink())
        while True:
            with foreign(f"recording: {path.name}", "a whole pcap or pcapng file is needed; record it again"):
                packet = next(packets, None)
            if packet is None:
                break
            when, raw = float(packet[0]), packet[1]
            zero = when if zero is None else zero
            segment = _segment(dpkt, link_type, raw)
            if segment is None:
                continue
            source, target, number, data = segment
            stream = streams.setdefault((*source, *target), _Stream())
            stream.add(number, data)
            for frame in stream.frames():
                answered = waiting.pop((target, source, frame[:2], frame[6]), None)
                if answered is not None:
                    found.append(answered.exchange(zero, when, frame[HEADER:]))
                elif frame[HEADER] in KNOWN:
                    address = ".".join(map(str, target[0])) if len(target[0]) == 4 else target[0].hex()
                    pending = _Pending(when, f"{address}:{target[1]}", frame[6], frame[HEADER:])
                    waiting[source, target, frame[:2], frame[6]] = pending
    found += [pending.exchange(zero or 0.0, pending.at, None) for pending in waiting.values()]
    yield from sorted(found, key=lambda exchange: exchange.at_s)


def _segment(dpkt: Any, link_type: int, raw: bytes) -> tuple[tuple[bytes, int], tuple[bytes, int], int, bytes] | None:
    """Source, target, sequence number and data of a TCP segment; None for any other packet, and for one without data."""
    layers = {
        0: "loopback.Loopback",
        1: "ethernet.Ethernet",
        12: "ip.IP",
        101: "ip.IP",
        113: "sll.SLL",
        228: "ip.IP",
        276: "sll2.SLL2",
    }
    if link_type not in layers:
        raise DataRejected(
            f"recording: packets of link type {link_type}; one of {', '.join(map(str, layers))} is needed"
        )
    module, name = layers[link_type].split(".")
    try:
        packet = getattr(getattr(dpkt, module), name)(raw)
        network = packet if name == "IP" else packet.data
        segment = network.data
    except Exception:  # noqa: BLE001 - a damaged or cut packet is none of this protocol; the others are read
        return None
    if not isinstance(segment, dpkt.tcp.TCP) or not segment.data:
        return None
    return (network.src, segment.sport), (network.dst, segment.dport), segment.seq, bytes(segment.data)


def _of_log(path: Path) -> Iterator[Exchange]:
    """The exchanges in a log whose lines are frames of RTU or TCP, each a request or an answer."""
    text = path.read_bytes().decode("utf-8-sig", errors="replace")
    zero, last = None, 0.0
    pending: _Pending | None = None
    for line in text.splitlines():
        part = _frame_in(line)
        if part is None:
            continue
        device_id, data = part
        at = _time_in(line)
        zero = at if zero is None else zero
        last = last if at is None or zero is None else at - zero
        answers = pending is not None and (pending.device_id, pending.data[0]) == (device_id, data[0] & ~EXCEPTION)
        if answers and pending is not None and not SENT.search(line):
            yield pending.exchange(0.0, max(last, pending.at), data)
            pending = None
        elif not RECEIVED.search(line) or SENT.search(line):
            if pending is not None:
                yield pending.exchange(0.0, pending.at, None)
            pending = _Pending(last, "log", device_id, data)
    if pending is not None:
        yield pending.exchange(0.0, pending.at, None)


def _frame_in(line: str) -> tuple[int, bytes] | None:
    """Device id and request or answer of the frame in a line; None without a valid one."""
    for match in BYTES.finditer(line):
        run = bytes.fromhex(re.sub(r"0x|[^0-9A-Fa-f]", "", match[1]))
        for data in (run[k:] for k in range(len(run) - FEWEST_BYTES + 1)):  # a number may stand before the frame
            if crc16(data[:-2]) == data[-2:] and (data[1] & ~EXCEPTION) in KNOWN:
                return data[0], data[1:-2]
            if len(data) > HEADER and data[2:4] == b"\0\0" and int.from_bytes(data[4:6], "big") == len(data) - 6:
                return data[6], data[HEADER:]
    return None


def _time_in(line: str) -> float | None:
    """The time of a line, s: its seconds of the day, of a date, or the number that it begins with."""
    if number := SECONDS.match(line):
        return float(number[1])
    clock = CLOCK.search(line)
    if clock is None:
        return None
    fraction = float(f"0.{clock[4]}") if clock[4] else 0.0
    seconds = 3600.0 * int(clock[1]) + 60.0 * int(clock[2]) + int(clock[3]) + fraction
    date = re.search(r"\d{4}-\d{2}-\d{2}", line)
    try:
        return seconds if date is None else datetime.fromisoformat(f"{date[0]}T00:00:00+00:00").timestamp() + seconds
    except ValueError:
        return seconds
