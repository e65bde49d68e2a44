"""Provenance: user, host, time and versions; stored in manifests, never in results or keys."""

import getpass
import platform
from datetime import UTC, datetime
from functools import cache
from typing import Any

from pipelines.archive.keys import libraries


def provenance() -> dict[str, Any]:
    """The user, the host, the moment, and the versions of the product and of the libraries that a number may depend on."""
    return {
        "who": getpass.getuser(),
        "where": platform.node(),
        "when": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "software": _software(),
        "libraries": libraries(),
    }


@cache
def _software() -> dict[str, str]:
    """Versions of the product and of what runs it; read from the installed packages."""
    from importlib.metadata import version  # here, because a short command that writes nothing does not need it

    return {"tumbleline": version("tumbleline"), "python": platform.python_version()}
