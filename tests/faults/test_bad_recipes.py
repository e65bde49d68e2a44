"""Recipes, models, manifests and slot maps beyond all bounds: refused with key or row."""

from pathlib import Path

import pytest
from each import each
from root_process import ROOT

from pipelines.archive import files as archive_files
from pipelines.jobs.recipes import load_recipe
from pipelines.jobs.seating import Seating, scan
from pipelines.procedures import parts_of
from schemas.errors import ArchiveUnusable, RecipeInvalid
from schemas.model import ModelFile
from schemas.toml_files import parse_as, parse_toml

RECIPE = ROOT / "schemas" / "samples" / "production.toml"
LAST = 'limits = "production"\n'


@each(
    [
        ("soak_min_s = 900.0", "soak_min_s = 9e302", "'soak_min_s': found 9e\\+302"),
        ("dwell_s = 10.0", "dwell_s = 1e200", "'dwell_s': found 1e\\+200"),
        ("dwell_s = 10.0", "dwell_s = true", "true and false are not numbers"),
        ("dwell_s = 10.0", 'dwell_s = "10"', "'dwell_s': found '10': a text, a number without quotes is needed"),
        ("seed = 1", 'seed = "1"', "'seed': found '1': a text, a number without quotes is needed"),
        (LAST, LAST + '[[procedures]]\nkind = "bias_stability"\npose_deg = ["1", 0]\n', "'pose_deg': a text, a number"),
        (LAST, LAST + '[[procedures]]\nkind = "exposure"\nlow_C = "1"\n', "'low_C': found '1': a text"),
        ("dwell_s = 10.0", "dwell_s = -10.0", "'dwell_s': found -10"),
        ("settle_s = 2.0", "settle_s = 1e300", "'settle_s': found 1e\\+300"),
        ("settle_s = 2.0", "settle_s = 1e6", "days, at most 366 are possible"),
        ("rate_hz = 100.0", "rate_hz = 1e200", "'rate_hz': found 1e\\+200"),
        ("rate_hz = 100.0", "rate_hz = 1e6", "static_record_s: 1.2e\\+09 samples in one record"),
        ("static_record_s = 1200.0", "static_record_s = 1e18", "'static_record_s': found"),
        ("[-10.0, 25.0, 60.0]", "[-400.0, 25.0]", "'temperatures_C', number 1: found -400"),
        ("seed = 1", "seed = -1", "'seed': found -1"),
        ("seed = 1", f"seed = {'9' * 5000}", "not valid TOML"),
        ("seed = 1", f"seed = 0x{'f' * 6000}", "'seed': found a int too large to show"),
        ("verification_repeats = 3", "verification_repeats = 9999999999", "'verification_repeats'"),
        ('name = "production"', f'name = "{"x" * 5000}"', "'name'"),
        ("seed = 1", f"seed = {'[' * 5000}", "nested too deeply"),
        ("seed = 1", f"seed.{'a.' * 3000}b = 1", "deep in one another|nested too deeply"),
        ("[[35.0, 15.0]", "[[1e200, 15.0]", "verification"),
    ],
    lambda row: row[1][-60:],
)  # fmt: skip
def test_recipes_beyond_all_bounds_are_refused_with_their_key(row: tuple[str, str, str], tmp_path: Path) -> None:
    (old, new, words), text = row, RECIPE.read_text()
    assert old in text
    (tmp_path / "r.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(RecipeInvalid, match=words) as refused:
        parts_of(load_recipe(str(tmp_path / "r.toml")))
    assert len(str(refused.value)) < 700


def test_nesting_and_long_integers_end_in_one_message_everywhere(tmp_path: Path) -> None:
    for text in ("a = " + "[" * 9999, "a = " + "{b=" * 9999, f"a = {'1' * 9999}"):
        with pytest.raises(RecipeInvalid, match="not valid TOML"):
            parse_toml(text, "f")
        with pytest.raises(RecipeInvalid):
            parse_as(ModelFile, text, "f")
    for text in ("[" * 100_000, '{"a": ' * 100_000, f'{{"a": {"1" * 9999}}}'):
        with pytest.raises(ArchiveUnusable, match="not a manifest"):
            archive_files.parsed(text.encode(), tmp_path / "m.json")
    (tmp_path / "r.toml").write_bytes(b"\xef\xbb\xbf" + RECIPE.read_bytes())
    assert load_recipe(str(tmp_path / "r.toml")).name == "production"  # a mark at the beginning is read over


def test_each_scan_is_checked_when_it_is_scanned() -> None:
    lines, words = iter(["=cmd|x", "A1", "АВ", "..", "B2"]), []
    assert scan(2, lambda _slot: next(lines), words.append) == Seating(("A1", "B2"), (0, 1))
    assert [text.split(":")[0] for text in words] == ["slot 0", "slot 1", "slot 1"]
