"""Messages of services and commands on standard error: a line of text, or of JSON where TUMBLELINE_LOG is ``json``."""

import json
import os
import sys
from datetime import UTC, datetime
from typing import Any

VARIABLE = "TUMBLELINE_LOG"
JSON = "json"


def wants_json() -> bool:
    """Whether messages are JSON."""
    return os.environ.get(VARIABLE, "").strip().lower() == JSON


def log_line(text: str, level: str = "info", **details: Any) -> str:
    """A message as it is written, with its line break.

    Parameters
    ----------
    details : further keys of the JSON object; as text they are left out, since the message says the same
    """
    if not wants_json():
        return f"tumbleline: {text}\n"
    when = datetime.now(UTC).isoformat(timespec="milliseconds")
    content = {"when": when, "level": level, "logger": "tumbleline", "process": os.getpid(), "message": text, **details}
    return json.dumps(content, ensure_ascii=False, default=str) + "\n"


def tell(text: str, level: str = "info", **details: Any) -> None:
    """Write a message to standard error in one call, so that lines of several processes do not mix."""
    sys.stderr.write(log_line(text, level, **details))
    sys.stderr.flush()
