"""The JSON documents of recordings: keys that other programs read."""

from __future__ import annotations

from typing import Annotated

from typing_extensions import TypedDict


class RecordedDeviceRow(TypedDict):
    """A device of a recording."""

    place: str
    link: Annotated[str, "name of its link, which is that of the link's first device"]
    device_id: int
    profile: Annotated[str, "empty for a recording of another program"]
    exchanges: int
    no_answer: int


class FrameRow(TypedDict):
    """A request and its answer."""

    at_s: float
    seconds: float
    place: str
    kind: Annotated[str, "read, order, refused or no answer"]
    what: str
    answer: str
    request_hex: str
    reply_hex: Annotated[str | None, "null without an answer"]


class FramesDocument(TypedDict):
    """A recording."""

    recording: str
    made: str
    purpose: str
    remark: Annotated[str, "why it is shorter than what it records; empty if it is whole"]
    devices: list[RecordedDeviceRow]
    frames: list[FrameRow]


class ReplayDocument(TypedDict):
    """Where a recording is served."""

    host: str
    port: Annotated[int, "of all devices with registers"]
    lines: Annotated[dict[str, int], "port of each device with lines of text"]
    devices: list[RecordedDeviceRow]
