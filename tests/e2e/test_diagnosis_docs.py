"""The tutorial and the guide to one's own effects run as they are printed."""

import math
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipelines.cli import main

DOCS = Path(__file__).resolve().parents[2] / "docs"
TUTORIAL = (DOCS / "tutorial" / "find-a-missing-effect.md").read_text(encoding="utf-8")
GUIDE = (DOCS / "how-to" / "add-your-own-effect.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])")
STAMP = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d")
CLOSE = 0.05
"""Numbers may differ so much between processors and library versions."""


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")

    def run(command: str) -> str:
        monkeypatch.setattr(sys, "argv", shlex.split(command))
        with pytest.raises(SystemExit) as left:
            main()
        captured = capsys.readouterr()
        assert left.value.code in {0, 1, None}, captured.err
        return captured.out

    return run


def examples(page: str) -> list[tuple[str, str]]:
    blocks = re.findall(r"```console\n\$ ([^\n]*)\n(.*?)```", page, flags=re.DOTALL)
    return [(command, printed) for command, printed in blocks]


def lines(text: str) -> list[str]:
    return [line.rstrip() for line in STAMP.sub("WHEN", text).splitlines() if line.strip()]


def same_line(one: str, other: str) -> bool:
    """Equal but for blanks and for numbers that are close."""
    if NUMBER.sub("#", one).split() != NUMBER.sub("#", other).split():
        return False
    pairs = zip(NUMBER.findall(one.replace("−", "-")), NUMBER.findall(other.replace("−", "-")), strict=True)
    return all(close(float(a), float(b)) for a, b in pairs)


def close(a: float, b: float) -> bool:
    if 0.0 < a < 1e-3 and 0.0 < b < 1e-3:  # probabilities: their exponents are compared
        return math.isclose(math.log10(a), math.log10(b), rel_tol=CLOSE)
    return math.isclose(a, b, rel_tol=CLOSE, abs_tol=0.02)


def test_the_tutorial_prints_what_it_says(typed):
    for command, printed in examples(TUTORIAL):
        shown, expected = lines(typed(command)), lines(printed)
        assert len(shown) == len(expected), "\n".join(shown)
        wrong = [(a, b) for a, b in zip(shown, expected, strict=True) if not same_line(a, b)]
        assert not wrong, command
    page = (Path("game") / "report.html").read_text(encoding="utf-8")
    assert "<th>scope</th>" in page
    assert "<th>parameters</th>" not in page  # no effect of this story has one
    assert (Path("game") / "history.png").is_file()


def test_the_model_of_the_guide_is_extended_as_printed(typed):
    blocks = re.findall(r"```toml\n(.*?)```", GUIDE, flags=re.DOTALL)
    Path("line.toml").write_text(blocks[0], encoding="utf-8")
    command, printed = examples(GUIDE)[0]
    assert lines(typed(command)) == lines(printed)


def test_the_effect_of_the_guide_is_an_effect(typed, rng, no_next_measurement: None):
    code = re.findall(r"```python\n(.*?)```", GUIDE, flags=re.DOTALL)[0]
    Path("swelling_glue.py").write_text(code, encoding="utf-8")
    n = 60
    force = rng.standard_normal((n, 3))
    force /= np.linalg.norm(force, axis=1, keepdims=True)
    humidity = 45.0 + 10.0 * np.sin(np.arange(n) / 6.0)
    late = np.concatenate([[0.0], np.diff(humidity)])
    out = force + 1e-5 * rng.standard_normal((n, 3)) + 1e-4 * (humidity - 2.0 * late - 45.0)[:, None]
    table = pd.DataFrame(
        {"unit": "A", "dwell": np.arange(n), "time_s": 600.0 * np.arange(n), "humidity_pct": humidity, "n": 100}
    )
    for k, axis in enumerate("xyz"):
        table[f"out_{axis}"], table[f"force_{axis}"], table[f"sd_{axis}"] = out[:, k], force[:, k], 1e-4
    table.to_parquet("dwells.parquet")
    assert "swelling_glue" in typed(examples(GUIDE)[1][0])
