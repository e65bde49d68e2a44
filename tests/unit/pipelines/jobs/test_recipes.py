"""Recipes: what is accepted, and that what is refused names the key and what to do."""

import shutil
from dataclasses import replace
from datetime import date
from importlib.resources import files
from pathlib import Path

import pytest
from capture_double import recipe_file, small_job
from each import each

from inertial.poses import NAMED
from pipelines.jobs.job import Request
from pipelines.jobs.recipes import load_recipe, read_limits, recipe_names
from pipelines.schedule.steps import steps
from schemas import own_files
from schemas.errors import RecipeInvalid, WrongUse
from schemas.prior import StoredFamily, StoredOwn
from schemas.reference import Reference
from schemas.station import load_station
from schemas.uncertainty import Uncertainty
from stations.plant.preset import load_preset
from stations.profile_files import load_profile

POSES = 'poses = "nine"'
LAST_EFFECT = '"scale_temperature"]'


REFUSED: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("temperatures_C =", "temperature_C =", ("unknown key 'temperature_C'", "did you mean temperatures_C")),
    ("local_gravity_m_s2 = 9.8123\n", "", ("local_gravity_m_s2",)),
    ("9.8123", "1.0", ("local_gravity_m_s2", "9.7")),
    (POSES, 'poses = "fibonaci24"', ("did you mean fibonacci24",)),
    ('"misalignment"', '"misalignement"', ("did you mean misalignment",)),
    ('limits = "consumer"', 'limits = "consumr"', ("did you mean consumer",)),
    (POSES, "poses = [[70, 0], [90, 90], [80, 180], [90, -90], [85, 45]]",
     ("fit: poses span 0.34 g on z, the recipe needs 1.4 g; add poses with z up and z down",)),
    (POSES, 'poses = "twelve"\nspan_min_g = 1.5', ("span 1.41 g",)),
    ("[0.0, 50.0]", '"50"', ("key 'temperatures_C': found '50': a list in brackets is needed, as [1, 2]",)),
    ("[0.0, 50.0]", "[0.0, 150.0]", ("temperatures_C", "150 °C", "-40 to 85 °C")),
    ("[105.0, -100.0]", "[105.0, -1000.0]", ("poses (inner)",)),
    ("settle_s = 2.0", "settle_s = 2.0\nsoak_min_s = 60.0", ("60 s", "900 s")),
    ("dwell_s = 1.0", "dwell_s = 0.5", ("50 samples per pose",)),
    ("[35.0, 15.0]", "[0.2, 15.0]", ("pose v1 lies 0.20° from pose p",)),
    (LAST_EFFECT, '"scale_temperature", "gravity_value"]', ("gravity_value",)),
    ("[0.0, 50.0]", "[25.0]", ("bias_temperature",)),
    ("static_record_s = 30.0", "static_record_s = 0.0",
     ("velocity_random_walk_ug_rtHz, bias_instability_ug need a static record",)),
    ("verification = [[35.0, 15.0], [105.0, -100.0]]", "verification = []",
     ("verification_ratio, bias_error_ug need verification poses",)),
    ('["A1", "A2", "A3"]', '["A1", "A1"]', ("A1 is there twice",)),
    ("[0.0, 50.0]", "[0.0, 25.0, 25.0]", ("twice in a row",)),
    ('name = "small"\n', 'name = "small\n', ("line 2",)),
)  # fmt: skip


@each(REFUSED, lambda row: row[1])
def test_what_is_refused_names_the_key_and_what_to_do(row: tuple[str, str, tuple[str, ...]], tmp_path: Path) -> None:
    old, new, said = row
    with pytest.raises(RecipeInvalid) as caught:
        small_job(tmp_path, (old, new))
    for words in said:
        assert words in str(caught.value)


@each([
    ((), ("A1", "A2", "A1"), "serial A1 is there twice"),
    ((('units = ["A1", "A2", "A3"]\n', ""),), (), "no unit is named"),
    ((), ("A1", ""), "serial '' is blank"),
    ((), tuple(f"S{n}" for n in range(9)),
     "9 units, the fixture has 8 slots; measure 2 lots.* --units S0,S1,S2,S3,S4,S5,S6,S7, then --units S8$"),
])  # fmt: skip
def test_a_lot_that_cannot_be_measured_is_refused(
    row: tuple[tuple[tuple[str, str], ...], tuple[str, ...], str], tmp_path: Path
) -> None:
    changes, units, said = row
    with pytest.raises(WrongUse, match=said):
        small_job(tmp_path, *changes, units=units)


def test_takes_named_plans_angles_short_soaks_that_somebody_answers_for_and_temperatures_that_come_again(
    tmp_path: Path,
) -> None:
    for plan in NAMED:
        assert small_job(tmp_path, (POSES, f'poses = "{plan}"')).recipe.poses
    angles = "poses = [[0, 0], [180, 0], [90, 0], [90, 180], [90, 90], [90, -90]]"
    poses = small_job(tmp_path, (POSES, angles)).recipe.poses
    assert [(pose.name, pose.inner_deg) for pose in poses][4:] == [("p5", 90.0), ("p6", -90.0)]
    small_job(tmp_path, ("settle_s = 2.0", "settle_s = 2.0\nsoak_min_s = 60.0\nallow_short_soak = true"))
    again = small_job(tmp_path, ("[0.0, 50.0]", "[0.0, 25.0, 50.0, 25.0, 0.0]"))
    assert again.recipe.temperatures_C[-1] == 0.0


def test_takes_the_model_from_a_file(tmp_path: Path) -> None:
    model = '[model]\nname = "line"\nversion = 2\neffects = ["bias", "scale"]\n'
    change = '[[change]]\nversion = 2\neffect = "scale"\nby = "QA"\nat = 2026-01-02\nwhy = "needed"\n'
    (tmp_path / "line.toml").write_text(model + change, encoding="utf-8")
    effects = 'effects = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]'
    limits = '[figures]\nresidual_rms_ug = { max = 1e5, unit = "µg" }\n'
    (tmp_path / "wide.toml").write_text('name = "wide"\n' + limits, encoding="utf-8")
    changes = (effects, 'model = "line.toml"'), ('limits = "consumer"', 'limits = "wide.toml"')
    recipe = small_job(tmp_path, *changes).recipe
    assert (recipe.model_name, recipe.model_version, recipe.effects) == ("line", 2, ["bias", "scale"])


def test_the_capture_is_shared_by_recipes_that_differ_in_the_model_only(tmp_path: Path) -> None:
    capture = small_job(tmp_path).capture_id
    assert small_job(tmp_path, ('"scale_temperature"]', '"scale_temperature", "second_order"]')).capture_id == capture
    assert small_job(tmp_path, ("[0.0, 50.0]", "[0.0, 51.0]")).capture_id != capture
    assert small_job(tmp_path, repeat=1).capture_id != capture  # a fresh measurement


ONE = [[[1.0]]]
OWN = {"A1": StoredOwn(mean=[[0.0]], covariance=ONE)}
PRIOR = StoredFamily(
    effects=["bias"], runs=["a"], mean=[[0.0]], unit=ONE, lot=ONE, error=ONE, units=9, lots=3, tails=ONE[0], own=OWN
)


@pytest.mark.parametrize(
    ("own", "names"),
    [("", 1), ("[stop]\nbias_ug = 900.0\n", 6), ("[stop]\nbias_ug = 900.0\n[certificate]\nvalidity_months = 6\n", 6)],
)
def test_a_capture_that_may_end_is_named_by_all_that_a_look_decides_by(tmp_path: Path, own: str, names: int) -> None:
    """What a budget rests on changes what is known, and nothing of a capture that takes every dwell."""
    limits = 'limits = "consumer"'
    small = small_job(tmp_path, (limits, f"{limits}\n{own}"))
    stated = small.recipe.model_copy(
        update={"uncertainty": Uncertainty.model_validate({"pose": {"u_urad": 2300.0, "source": "x"}})}
    )
    slower = small.station.pace.model_copy(update={"record_s": 9.0})
    reference = Reference(id="R1", what="table", laboratory="L", certificate="C", due=date(2099, 1, 1))
    several = [
        small,
        replace(small, recipe=stated),
        replace(small, station=small.station.model_copy(update={"pace": slower})),
        replace(small, station=small.station.model_copy(update={"reference": [reference]})),
        replace(small, prior=PRIOR),
        replace(small, prior=PRIOR.model_copy(update={"runs": ["other"]})),
    ]
    assert len({job.capture_id for job in several}) == names
    older = PRIOR.model_copy(update={"own": {"A1": StoredOwn(mean=[[0.0]], covariance=[[[2.0]]])}})
    assert replace(small, prior=older).capture_id == several[-2].capture_id  # a killed capture is gone on with


SOAKS = """
[[soaks]]
temperature_C = 25.0
poses = [1, 3, 5, 1]

[[soaks]]
temperature_C = -10.0
poses = [2, 4, 6, 8]
verification = []

[[soaks]]
temperature_C = 25.0
"""


def test_a_recipe_may_say_soak_by_soak_which_poses_are_measured(tmp_path: Path) -> None:
    in_soaks = [("temperatures_C = [0.0, 50.0]\n", ""), ('limits = "consumer"', 'limits = "consumer"' + SOAKS)]
    recipe = load_recipe(recipe_file(tmp_path, *in_soaks))
    assert recipe.temperatures_C == [25.0, -10.0, 25.0]
    assert [p.name for p in recipe.poses_at(0)] == ["p1", "p3", "p5", "p1"]
    assert (recipe.verification_at(1), recipe.verification_at(2)) == ([], recipe.verification)
    records = [s for s in steps(recipe) if s.kind != "allan"]
    assert len(records) == 4 + len(recipe.verification) + 4 + len(recipe.poses) + len(recipe.verification)
    assert len(steps(recipe)) == recipe.planned_records
    with pytest.raises(RecipeInvalid, match="soak 2 names poses 10, there are 9"):
        load_recipe(recipe_file(tmp_path, *in_soaks, ("8]", "10]")))


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


def test_a_recipe_is_found_in_the_working_folder_before_that_of_the_user_and_reported_once(
    home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = put(home, "recipes", "my", RECIPE.replace("dwell_s = 10.0", "dwell_s = 20.0"))
    lines: list[str] = []
    own_files.report_to(lines.append)
    assert load_recipe("my").dwell_s == load_recipe("my").dwell_s == 20.0
    own_files.report_to(lambda _line: None)
    assert lines == [f"recipe 'my': {path}"]
    for dwell_s in (20.0, 30.0):  # the same content in both folders is not told, another one is told once
        put(Path(), "recipes", "my", RECIPE.replace("dwell_s = 10.0", f"dwell_s = {dwell_s}"))
        assert load_recipe("my").dwell_s == load_recipe("my").dwell_s == dwell_s
        said = capsys.readouterr().err
        assert said.count("has other content and is not used") == (str(path) in said) == (dwell_s == 30.0)
    assert "my" in recipe_names()
    for wrong, meant in (("mmy", "my"), ("produktion", "production")):
        with pytest.raises(RecipeInvalid, match=f"did you mean {meant}"):
            load_recipe(wrong)
    assert own_files.own_file("recipes", "../recipes/my") is None  # a path is not searched
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("XDG_CONFIG_HOME", "config")  # a relative folder is ignored
    assert own_files.folders("limits")[1] == home / ".config" / "tumbleline" / "limits"


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
    put(home, "presets", "quiet", 'name = "loud"\n')
    with pytest.raises(RecipeInvalid, match="key 'name': 'loud', 'quiet' as in the name of the file is needed"):
        load_preset("quiet")
    for name, load in (("production", load_recipe), ("consumer", read_limits)):  # a file in the working folder
        Path(name).write_text("name = 'other'\n", encoding="utf-8")
        with pytest.raises(RecipeInvalid, match=f"'{name}' is built in, and {name} has the same name"):
            load(name)


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
