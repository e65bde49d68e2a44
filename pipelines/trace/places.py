"""Where the events of a unit lie."""

from __future__ import annotations

import hashlib

FOLDER = "calibrations"


def folder_of(serial: str) -> str:
    """Folder of a unit's events below the archive's root."""
    name = hashlib.sha256(serial.encode("utf-8", "surrogateescape")).hexdigest()
    return f"{FOLDER}/{name[:2]}/{name[:16]}"
