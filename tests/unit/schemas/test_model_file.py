"""Model files."""

from pathlib import Path

import pytest

from schemas.errors import RecipeInvalid
from schemas.model import load_model, parse_model

GOOD = """
[model]
name = "line"
version = 2
effects = ["bias", "scale"]

[[change]]
version = 1
by = "A. Tester"
at = 2026-01-01
why = "start"

[[change]]
version = 2
effect = "scale"
by = "A. Tester"
at = 2026-02-01
why = "residuals follow the force"
"""


def test_reads_versions_and_who_changed_them() -> None:
    model = parse_model(GOOD, "model")
    assert model.model.effects == ["bias", "scale"]
    assert [change.by for change in model.change] == ["A. Tester", "A. Tester"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("version = 2\neffects", "version = 3\neffects", "every version needs its"),
        ('["bias", "scale"]', '["bias", "bias"]', "bias is there twice"),
        ('why = "start"', 'wy = "start"', "did you mean why"),
        ("version = 1\n", "version = 2\n", "do not rise"),
    ],
)
def test_refuses_what_does_not_fit_together(old: str, new: str, message: str) -> None:
    with pytest.raises(RecipeInvalid, match=message):
        parse_model(GOOD.replace(old, new), "model")


def test_names_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(RecipeInvalid, match=r"none\.toml cannot be read"):
        load_model(tmp_path / "none.toml")
