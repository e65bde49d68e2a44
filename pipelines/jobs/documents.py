"""The JSON documents of release: keys that other programs read."""

from typing import Annotated

from typing_extensions import TypedDict

ReleaseRecord = TypedDict(
    "ReleaseRecord",
    {
        "release": Annotated[int, "number, from 1"],
        "model": str,
        "version": int,
        "effects": list[str],
        "from": Annotated[str, "first moment of use, ISO date and time, UTC"],
        "device": Annotated[str, "empty: every kind"],
        "station": Annotated[str, "empty: every station"],
        "reason": str,
        "evidence": Annotated[str, "the what-if that supports it; empty if forced"],
        "forced": bool,
        "by": str,
        "at": Annotated[str, "ISO date and time, UTC"],
    },
)
ReleaseRecord.__doc__ = "A model that is released to the line."


class ReleaseDocument(ReleaseRecord):
    """``release MODEL --json``: the release that was made."""

    archive: str


class ListedRelease(ReleaseRecord):
    """A release, and whether it is in use."""

    in_use: Annotated[bool, "today, for its device and station"]


class ReleaseListDocument(TypedDict):
    """``release --json``: the releases of the archive, the oldest first."""

    archive: str
    releases: list[ListedRelease]
