"""Pages of the documents: the commands that they print, what stands below each, and whether that is what is printed."""

import math
import re
from pathlib import Path

from approved import CHANGING, NUMBER

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "deploy").glob("*.md"))]
VERDICTS = ("NOT ADEQUATE", "no calibration is valid", "CANNOT BE JUDGED")
"""What is printed by a command that ends with status 1."""


def text(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def blocks(page: str, kind: str) -> list[str]:
    """The blocks of a page in one language."""
    return re.findall(rf"```{kind}\n(.*?)```", text(page), flags=re.DOTALL)


def examples(page: str) -> list[tuple[str, str]]:
    """Every command of the console blocks of a page, without its remark, with what stands below it."""
    found = [
        example
        for block in blocks(page, "console")
        for example in re.findall(r"^\$ (tumbleline .*)\n((?:(?!\$ ).*\n)*)", block, flags=re.MULTILINE)
    ]
    return [(re.split(r"  #", command)[0].strip(), printed) for command, printed in found]


def words(printed: str) -> str:
    """A text without dates, lines of tables and blanks but one."""
    for pattern, new in CHANGING[:2]:
        printed = re.sub(pattern, new, printed)
    return " ".join(re.sub(r"[─\s]+", " ", printed).split())


def unlike(shown: str, printed: str, close: float) -> str:
    """How what is shown differs from what a page prints; ``…`` stands for anything, numbers may differ by this share."""
    wanted, found = words(printed), words(shown)
    parts = re.split(f"({NUMBER.pattern})", wanted)
    numbers = [_value(part) for part in parts[1::2]]
    pattern = "".join(
        f"({NUMBER.pattern})" if k % 2 else re.sub(r"(\\ )?…(\\ )?", ".*?", re.escape(part))
        for k, part in enumerate(parts)
    )
    match = re.fullmatch(pattern, found)
    if match is None:
        return f"printed:\n{wanted}\nfound:\n{found}"
    pairs = zip(numbers, map(_value, match.groups()), strict=True)
    return ", ".join(f"{a:g} is {b:g}" for a, b in pairs if not _alike(a, b, close))


def _value(number: str) -> float:
    return float(number.replace("−", "-"))


def _alike(a: float, b: float, close: float) -> bool:
    if close and 0.0 < a < 1e-3 and 0.0 < b < 1e-3:  # probabilities: their exponents are compared
        return math.isclose(math.log10(a), math.log10(b), rel_tol=close)
    return math.isclose(a, b, rel_tol=close, abs_tol=0.02 if close else 0.0)
