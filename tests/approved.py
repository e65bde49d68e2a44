"""The text that a command prints, against the one that was approved: ``tests/data/approved/<command>.txt``.

``APPROVE=1`` in the environment writes the files again, for a review of the difference.
"""

import math
import os
import re
from pathlib import Path

FOLDER = Path(__file__).resolve().parent / "data" / "approved"
VARIABLE = "APPROVE"
CLOSE = 0.02
"""Numbers may differ so much between processors and versions of libraries; signs, words and their order may not."""

CHANGING = (
    (r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\.\d+)?(\+00:00|Z)?", "TIME"),
    (r"\d{4}-\d\d-\d\d", "DATE"),
    (r"(?<![.\d])\b(?=\d*[a-f])[0-9a-f]{10,64}\b", "HASH"),
    (r"\b[0-9.]+ (s|ms|kB|MB|GB)\b", r"# \1"),
    (r"─+", "─"),
)
"""What differs from one run of a command to the next."""

NUMBER = re.compile(r"(?<![\w.])[-−+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])")


def normalised(text: str, folder: Path, names: dict[str, str]) -> str:
    """A text without times, hashes, sizes, the names of its runs and its folder; one blank for several."""
    for old, new in {str(folder): "FOLDER", **names}.items():
        text = text.replace(old, new)
    for pattern, new in CHANGING:
        text = re.sub(pattern, new, text)
    return "\n".join(line for line in (" ".join(one.split()) for one in text.splitlines()) if line) + "\n"


def difference(name: str, text: str) -> str:
    """What a normalised text has that the approved one of this name has not; empty where they agree."""
    path = FOLDER / f"{name}.txt"
    if os.environ.get(VARIABLE):
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return ""
    if not path.is_file():
        return f"{path.name}: not approved yet; run with {VARIABLE}=1 and review it"
    approved = path.read_text(encoding="utf-8")
    if NUMBER.sub("#", text).split() != NUMBER.sub("#", approved).split():
        return f"{path.name} is\n{approved}\nfound\n{text}\n{VARIABLE}=1 approves it"
    pairs = zip(map(_value, NUMBER.findall(text)), map(_value, NUMBER.findall(approved)), strict=True)
    far = [f"{b:g} is {a:g}" for a, b in pairs if not math.isclose(a, b, rel_tol=CLOSE, abs_tol=1e-12)]
    return f"{path.name}: {', '.join(far)}" if far else ""


def _value(number: str) -> float:
    return float(number.replace("−", "-"))
