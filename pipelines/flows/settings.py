"""What the orchestrator must be told before it is imported: where its history lives, and to keep to itself."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

LOCAL = "local"
"""Instead of a Dask scheduler's address: a cluster of processes on this machine."""

STARTUP_S = 120


def settings(home: Path, port: int) -> dict[str, str]:
    """Environment of a local orchestrator, server or client: persistent history, no telemetry, no way out."""
    address = f"http://127.0.0.1:{port}/api"
    return {
        "PREFECT_HOME": str(home),
        "PREFECT_API_URL": address,
        "PREFECT_SERVER_ALLOW_EPHEMERAL_MODE": "false",  # the temporary server loses most of a run's history
        "PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS": str(STARTUP_S),
        "PREFECT_SERVER_UI_API_URL": address,
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        "DO_NOT_TRACK": "1",
        "PREFECT_LOGGING_LEVEL": os.environ.get("PREFECT_LOGGING_LEVEL", "CRITICAL"),
    }
