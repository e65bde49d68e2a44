"""Texts that a newcomer met and could not use: what they say now, and how numbers are written in them."""

import re
from pathlib import Path
from typing import Any, cast

import pytest
from capture_double import recipe_file
from each import each
from in_process import given, text_of
from root_process import ROOT

from inertial.counts import size_text
from inertial.planning.ranges import UnseenRange
from pipelines.archive import Archive
from pipelines.cli import flowing
from pipelines.cli.text.discovery_text import print_explained
from pipelines.diagnosis.confirmation import fall_of
from pipelines.discovery.sentences import support_text
from pipelines.jobs.job import Request
from pipelines.jobs.recipes import load_recipe
from pipelines.report.unit_panels.budget import without_nothing
from schemas.errors import RecipeInvalid
from schemas.key_list import keys_of
from schemas.station import StationConfig, load_station
from schemas.toml_files import PATTERNS


def all_said(*words: object) -> str:
    """Standard output and error of a command as one line."""
    return " ".join(" ".join(given(*words)[1:]).split())


def test_what_cannot_be_is_refused_with_what_is_needed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    changes = ("[[35.0, 15.0], [105.0, -100.0]]", "[]"), ("static_record_s = 30.0", "static_record_s = 0.0")
    blind = recipe_file(tmp_path, *changes, name="blind.toml")
    needed = r"bias_error_ug\S* need verification poses; .* needs? a static record"
    with pytest.raises(RecipeInvalid, match=needed) as by_run:
        Request(blind).job(Archive(tmp_path / "archive"))
    assert str(by_run.value) in all_said("plan", blind)  # every limit, in the words of the run
    with pytest.raises(RecipeInvalid, match=r"found 'my recipe'.* a to z, digits and . _ - are needed, a letter or"):
        load_recipe(recipe_file(tmp_path, ('"small"', '"my recipe"'), name="name.toml"))
    dwells = tmp_path / "dwells.csv"
    dwells.write_text(DWELL + "A1,0,0,0,0,1,0.01,oops,1.01,40\nA1,1,60,0,0,-1,0.01,0.02,-1.01,41\n", encoding="utf-8")
    assert "column out_y: found oops, a finite number is needed" in all_said("inspect", dwells)
    assert f"tumbleline compare {dwells}" in all_said("fit", dwells)


def test_numbers_have_three_digits_and_no_exponent() -> None:
    assert str(UnseenRange("tau", "s", 1118.0, 3000.0)) == "tau 1120 to 3000 s"
    assert str(UnseenRange("tau", "s", 36000.0, 36000.0)) == "tau 36000 s"
    assert str(UnseenRange("tau", "s", 0.0123, 0.5)) == "tau 0.0123 to 0.5 s"
    sizes = {1: "1 byte", 512: "512 bytes", 2_000: "2.00 kB", 18721670: "18.7 MB", 123_456_789_000: "123 GB"}
    assert {size: size_text(size) for size in sizes} == sizes
    assert fall_of(97.13, 2.8) == "the error falls by 97.1 ± 5.6 (k = 2) µg"
    assert fall_of(-6.41, 0.7) == "the error rises by 6.4 ± 1.4 (k = 2) µg"
    assert fall_of(123.4, None) == "the error falls by 123 µg"


def test_a_contribution_of_nothing_is_not_among_the_largest_and_a_help_is_broken_by_the_terminal_alone() -> None:
    text = "noise of the dwells 99 %, references, as far as verification cannot show them 1 %, seat of the fixture 0 %"
    assert without_nothing(text) == text.removesuffix(", seat of the fixture 0 %")
    assert without_nothing("noise of the dwells 80 %, supply 20 %") == "noise of the dwells 80 %, supply 20 %"
    assert flowing("One line\nand its end.\n\n- a list\n- stays") == "One line and its end.\n\n- a list\n- stays"


def test_patterns_and_expanded_uncertainties_of_a_schema_are_explained_in_words() -> None:
    rooms = (ROOT / "schemas", ROOT / "pipelines", ROOT / "stations")
    text = "".join(path.read_text(encoding="utf-8") for room in rooms for path in room.rglob("*.py"))
    stated = re.findall(r'[(\s]pattern=r"(.*?)"[,)]', text)
    assert len(stated) > 10
    assert set(stated) <= set(PATTERNS)
    meanings = {key.name: key.meaning for key in keys_of(StationConfig)}
    assert meanings["offset_U_ug"] == "Expanded uncertainty of the offset, µg; its factor is 'k'."


@each([
    (load_recipe, "line-six.toml", "line-six", "line-seven.toml"),
    (load_recipe, "line-six", "line-six", "line-seven.toml"),
    (load_recipe, "recipes/line-six.toml", "line-six", "line-seven.toml"),
    (load_station, "simulated-awry", "", "simulated-calm"),
    (load_station, "simulated-awry.toml", "", "simulated-calm"),
])  # fmt: skip
def test_a_sample_recipe_or_station_that_is_not_here_is_named_with_its_path(row: tuple) -> None:
    load, name, own_name, unknown = row
    kind = str if load is load_recipe else Path
    with pytest.raises(RecipeInvalid) as end:
        load(kind(name))
    path = Path(str(end.value).rpartition("the sample of this name is ")[2])
    assert path.is_file()
    loaded = load(kind(path))
    assert loaded.name == own_name if own_name else loaded.simulation is not None
    with pytest.raises(RecipeInvalid) as end:
        load(kind(unknown))
    assert "sample" not in str(end.value)


DWELL = "unit,dwell,time_s,force_x,force_y,force_z,out_x,out_y,out_z,humidity_pct\n"


def test_inspect_sends_dwells_in_the_exchange_format_to_diagnose(tmp_path: Path) -> None:
    path = tmp_path / "my dwells.csv"
    path.write_text(DWELL + "A1,0,0,0,0,1,0.01,0.02,1.01,40\nA1,1,60,0,0,-1,0.01,0.02,-1.01,41\n", encoding="utf-8")
    printed = text_of("inspect", path, status=0)
    assert printed.endswith(f"tumbleline diagnose '{path}'")
    assert "1 unit, 2 dwells; reference: the force on each axis" in printed
    assert {"reference", "covariate"} <= set(printed.split())
    assert "--map" not in printed


def test_a_discovery_asks_for_what_can_be_done(capsys: pytest.CaptureFixture[str]) -> None:
    """Without a map there is none to look at; an error of the references is not to be confirmed by later lots."""
    row = {"id": "D1", "since": "2026-03-14", "lots_then": 40, "driver": "wafer", "level": "", "axes": ["x"], "map": []}
    print_explained(cast("Any", {**row, "log_e": 12.0, "nearest": "third_order"}))
    text = capsys.readouterr().out
    assert "measure more lots" in text
    assert "--output" not in text
    assert support_text(cast("Any", {"carried_by": {"lots_for": None}, "confirmed": None})) == []
