"""Files of the deployment that come with the product: samples of recipes and stations, the lock of libraries."""

import sysconfig
from pathlib import Path

PRODUCT = "tumbleline"


def shipped(name: str) -> Path | None:
    """A file or folder of the deployment: of the source tree, else of ``share/tumbleline``; None where it is in neither."""
    tree = Path(__file__).resolve().parents[1]
    places = [tree] if (tree / "pyproject.toml").is_file() else []
    paths = [folder / name for folder in (*places, Path(sysconfig.get_path("data")) / "share" / PRODUCT)]
    return next((path for path in paths if path.exists()), None)


def hint_of_sample(kind: str, name: str) -> str:
    """The end of a message about a file that is not there: the path of the sample of this name, with or without its suffix.

    Empty where ``deploy`` has no such sample of a recipe or station (``kind``).
    """
    sample = shipped(f"deploy/{kind}s/{Path(name).name.removesuffix('.toml')}.toml") if "\0" not in name else None
    return f"; the sample of this name is {sample}" if sample is not None else ""
