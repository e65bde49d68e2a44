"""Caches of the archive (list of runs, events of the ledger, index of the audit), each with a seal.

A seal holds the hashes of the cached content and is signed where a key is configured. A cache that does not match its seal is
made again from the files of the archive, with a warning. A cache that another key signed is made again without one. Who can write
to an unsigned archive can also forge a seal: ``tumbleline verify`` makes every cache again and compares.
"""

import json
import logging
from collections.abc import Mapping
from typing import Any

from pipelines.archive import files
from pipelines.archive.signatures import BAD, GOOD, check, public_keys, signed
from pipelines.archive.store import Place

SOUND, OTHERS, EDITED = "sound", "made by others", "edited"
LOGGER = logging.getLogger("tumbleline.archive")


def seal(hashes: Mapping[str, str]) -> dict[str, Any]:
    """A seal over the hash of each part of a cache."""
    return signed({"files": dict(hashes)})


def standing(seal: object, hashes: Mapping[str, str]) -> str:
    """``sound``, ``edited``, or ``made by others`` (an own key is configured and did not sign it).

    seal : the seal in the file.
    hashes : of the parts of the cache as they are now.
    """
    if not isinstance(seal, dict) or seal.get("files") != dict(hashes):
        return EDITED
    keys = public_keys()
    if not keys:
        return SOUND
    return {GOOD: SOUND, BAD: EDITED}.get(check(seal, keys), OTHERS)


def framed(data: bytes) -> bytes:
    """Bytes with a first line that holds their seal."""
    return json.dumps(seal({"data": files.hash_of(data)}), sort_keys=True).encode() + b"\n" + data


def unframed(path: Place) -> tuple[bytes, str]:
    """The content of a sealed file and the state of its seal; no content where the seal is not sound.

    Raises OSError, ArchiveUnusable: the file is not there or cannot be read.
    """
    first, _, data = path.read_bytes().partition(b"\n")
    try:
        stored = json.loads(first)
    except (ValueError, RecursionError):
        stored = None
    state = standing(stored, {"data": files.hash_of(data)})
    return (data if state == SOUND else b""), state


def warn_of_edits(path: Place) -> None:
    """Warn that a cache was edited and is made again."""
    LOGGER.warning(
        "archive: %s was edited since it was made from the archive's files; it is not used and is made again, see 'tumbleline "
        "verify'",
        path,
    )
