"""Files of the deployment that come with the product: samples of recipes and stations, the lock of libraries."""

from __future__ import annotations

import sysconfig
from pathlib import Path

PRODUCT = "tumbleline"


def shipped(name: str) -> Path | None:
    """A file or folder of the deployment: of the source tree, else of ``share/tumbleline``; None where it is in neither."""
    tree = Path(__file__).resolve().parents[1]
    places = [tree] if (tree / "pyproject.toml").is_file() else []
    paths = [place / name for place in (*places, Path(sysconfig.get_path("data")) / "share" / PRODUCT)]
    return next((path for path in paths if path.exists()), None)
