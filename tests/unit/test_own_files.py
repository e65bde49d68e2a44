"""Files of the user by name: from the working folder, then from the user's folder; never in place of a built-in one."""

import os
import shutil
from importlib.resources import files
from pathlib import Path

import pytest

from pipelines.jobs.job import Request
from pipelines.jobs.recipes import load_recipe, read_limits, recipe_names
from schemas import own_files
from schemas.errors import RecipeInvalid
from schemas.station import load_station
from stations.plant.preset import load_preset
from stations.profile_files import load_profile

SAMPLES = files("schemas") / "samples"
RECIPE = SAMPLES.joinpath("production.toml").read_text("utf-8")


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder; the working folder is another one."""
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "config" / "tumbleline"


def put(folder: Path, kind: str, name: str, text: str) -> Path:
    path = folder / kind / f"{name}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def test_a_recipe_is_found_in_the_working_folder_before_that_of_the_user(home: Path) -> None:
    put(home, "recipes", "my", RECIPE.replace("dwell_s = 10.0", "dwell_s = 20.0"))
    assert load_recipe("my").dwell_s == 20.0
    put(Path(), "recipes", "my", RECIPE.replace("dwell_s = 10.0", "dwell_s = 30.0"))
    assert load_recipe("my").dwell_s == 30.0
    assert "my" in recipe_names()


def test_a_shadowed_file_of_other_content_is_told_once_and_the_same_content_is_not(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, mine in (("other", "dwell_s = 20.0"), ("same", "dwell_s = 10.0")):
        put(home, "recipes", name, RECIPE.replace("dwell_s = 10.0", mine))
        put(Path(), "recipes", name, RECIPE)
        load_recipe(name)
        load_recipe(name)
    said = capsys.readouterr().err
    assert said.count("has other content and is not used") == 1
    assert str(home / "recipes" / "other.toml") in said


def test_limits_a_station_a_profile_and_a_preset_are_found(home: Path) -> None:
    put(home, "limits", "mine", SAMPLES.joinpath("limits-consumer.toml").read_text("utf-8"))
    assert read_limits("mine").figures
    station = files("stations").joinpath("simulated.toml").read_text("utf-8")
    put(home, "stations", "line", station.replace('name = "simulated"', 'name = "line"').replace("watlow_f4t", "oven"))
    assert load_station(Path("line")).name == "line"
    profile = files("stations").joinpath("profiles", "watlow_f4t.toml").read_text("utf-8")
    put(home, "profiles", "oven", profile.replace('name = "watlow_f4t"', 'name = "oven"'))
    assert load_profile("oven").adapter == "watlow_f4t"
    preset = files("stations.plant").joinpath("presets", "adxl355.toml").read_text("utf-8")
    put(home, "presets", "quiet", preset.replace('name = "ADXL355"', 'name = "quiet"'))
    assert load_preset("quiet").output_unit == "LSB"


def test_a_name_means_one_file(home: Path) -> None:
    path = put(home, "recipes", "production", RECIPE)
    with pytest.raises(RecipeInvalid, match=r"'production' is built in, and .*production\.toml has the same name"):
        load_recipe("production")
    path.unlink()
    put(home, "presets", "adxl355", "name = 'adxl355'")
    with pytest.raises(RecipeInvalid, match="is built in"):
        load_preset("ADXL355")


def test_a_name_that_is_a_path_is_not_searched(home: Path) -> None:
    put(home, "recipes", "my", RECIPE)
    assert own_files.own_file("recipes", "../recipes/my") is None
    with pytest.raises(RecipeInvalid, match="did you mean my"):
        load_recipe("mmy")


def test_a_preset_whose_name_differs_from_its_file_is_refused(home: Path) -> None:
    put(home, "presets", "quiet", 'name = "loud"\n')
    with pytest.raises(RecipeInvalid, match="key 'name': 'loud', 'quiet' as in the name of the file is needed"):
        load_preset("quiet")


def test_the_file_that_is_used_is_reported_once(home: Path) -> None:
    path = put(home, "recipes", "my", RECIPE)
    lines: list[str] = []
    own_files.report_to(lines.append)
    load_recipe("my")
    load_recipe("my")
    own_files.report_to(lambda _line: None)
    assert lines == [f"recipe 'my': {path}"]


def test_a_changed_preset_of_ones_own_is_measured_anew(home: Path) -> None:
    built_in = Request().job()
    assert "own_files" not in built_in.about
    preset = files("stations.plant").joinpath("presets", "adxl355.toml").read_text("utf-8").replace("ADXL355", "quiet")
    path = put(home, "presets", "quiet", preset)
    put(home, "recipes", "my", RECIPE.replace('device = "adxl355"', 'device = "quiet"').replace("ADXL355", "quiet"))
    first = Request("my").job()
    assert first.capture_id != built_in.capture_id
    assert set(first.about["own_files"]) == {"presets/quiet"}
    path.write_text(preset + "\n# the same figures, another file\n", encoding="utf-8")
    assert Request("my").job().capture_id != first.capture_id
    shutil.rmtree(home)
    assert Request().job().capture_id == built_in.capture_id
    assert os.environ["XDG_CONFIG_HOME"]


def test_a_relative_folder_of_the_configuration_is_ignored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CONFIG_HOME", "config")
    assert own_files.folders("limits")[1] == tmp_path / ".config" / "tumbleline" / "limits"


def test_a_file_with_the_bare_name_of_a_built_in_recipe_or_limits_is_not_taken_in_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pipelines.jobs.recipes import load_recipe, read_limits

    monkeypatch.chdir(tmp_path)
    for name in ("production", "consumer"):
        Path(name).write_text("name = 'other'\n", encoding="utf-8")
    with pytest.raises(RecipeInvalid, match="'production' is built in, and production has the same name"):
        load_recipe("production")
    with pytest.raises(RecipeInvalid, match="'consumer' is built in"):
        read_limits("consumer")
