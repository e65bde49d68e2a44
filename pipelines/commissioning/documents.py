"""The JSON documents of bring-ups and recordings: keys that other programs read."""

from typing import Annotated, Literal

from typing_extensions import TypedDict

from stations.bringup.person import Point

Platform = Literal["hardware", "simulator", "replay", "not stated"]


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
    """``station frames --json``: a recording with all its frames."""

    recording: str
    made: str
    purpose: str
    remark: Annotated[str, "why it is shorter than what it records; empty if it is whole"]
    devices: list[RecordedDeviceRow]
    frames: list[FrameRow]


class ReplayDocument(TypedDict):
    """``station replay --json``: where a recording is served, printed when it is ready."""

    host: str
    port: Annotated[int, "of all devices with registers"]
    lines: Annotated[dict[str, int], "port of each device with lines of text"]
    devices: list[RecordedDeviceRow]


class AnswerTimes(TypedDict):
    """How long answers took."""

    usual_ms: float
    slowest_ms: float
    timeout_s: Annotated[float, "time-out that the bring-up used"]


class ConformanceDocument(TypedDict):
    """``station bring-up --json``: what a bring-up has found, per register and per promise of the device's family."""

    format: str
    profile: str
    maker: str
    model: str
    verified_on: Annotated[Platform, "what the person said is at the other end"]
    by: Annotated[str, "who did it; empty if not stated"]
    made: str
    link: Annotated[str, "tcp, tls, rtu, ascii or visa"]
    device_id: int
    complete: Annotated[bool, "false: it ended before its last step"]
    ended: Annotated[str, "why it ended early"]
    held: int
    differs: int
    not_tried: int
    points: list[Point]
    answers: AnswerTimes
    left: Annotated[list[str], "what was done to leave the device as it was found"]
    recording: Annotated[str, "name of the file with every frame"]
    corrected_profile: Annotated[str, "name of the profile with corrected rows; empty if none is needed"]
