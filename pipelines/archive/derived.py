"""What an archive keeps only to be quick, believed only as far as it is sealed: the list, the ledger's events, the audit's index.

A seal holds the hashes of what was derived and is signed where a key is there. What was edited is made again from the files that
it was derived from, and that is said; where an own key is configured, so is what it did not sign, silently. Who may write an
unsigned archive can write a seal to match: ``tumbleline verify`` derives everything anew and compares.
"""

from __future__ import annotations

import json
import logging
from typing import TYPE_CHECKING, Any

from pipelines.archive import files
from pipelines.archive.signatures import BAD, GOOD, check, public_keys, signed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pipelines.archive.store import Place

SOUND, OTHERS, EDITED = "sound", "made by others", "edited"
LOGGER = logging.getLogger("tumbleline.archive")


def seal(hashes: Mapping[str, str]) -> dict[str, Any]:
    """A seal of what was derived, by the hash of each part of it."""
    return signed({"files": dict(hashes)})


def standing(found: object, hashes: Mapping[str, str]) -> str:
    """``sound``, ``edited``, or ``made by others`` (an own key is configured and did not sign it).

    Parameters
    ----------
    found : the seal as it was read.
    hashes : of the parts as they are now.
    """
    if not isinstance(found, dict) or found.get("files") != dict(hashes):
        return EDITED
    keys = public_keys()
    if not keys:
        return SOUND
    return {GOOD: SOUND, BAD: EDITED}.get(check(found, keys), OTHERS)


def framed(data: bytes) -> bytes:
    """Bytes behind a first line that seals them."""
    return json.dumps(seal({"data": files.hash_of(data)}), sort_keys=True).encode() + b"\n" + data


def unframed(place: Place) -> tuple[bytes, str]:
    """What lies behind the seal of a file, and how it stands; nothing of what is not sound.

    Raises
    ------
    OSError, ArchiveUnusable
        The file is not there or cannot be read.
    """
    first, _, data = place.read_bytes().partition(b"\n")
    try:
        found = json.loads(first)
    except (ValueError, RecursionError):
        found = None
    state = standing(found, {"data": files.hash_of(data)})
    return (data if state == SOUND else b""), state


def tell_edited(place: Place) -> None:
    """Say that something derived was edited and is made again."""
    LOGGER.warning(
        "archive: %s was edited since it was made from the archive's files; it is not used and is made again, see 'tumbleline "
        "verify'",
        place,
    )
