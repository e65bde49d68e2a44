"""The loop on a recorded covariate: measured, diagnosed, extended, measured again with the model; the error falls."""

import json
from pathlib import Path

import inquiries
import numpy as np
import pytest
from typer.testing import CliRunner

from pipelines.archive import Archive
from pipelines.cli import app
from schemas.errors import RecipeInvalid
from schemas.station import load_station

HUMID = "covariate:humidity_pct"
MODEL = ["bias", "scale", "misalignment"]


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A station whose reader records humidity, devices whose glue swells with it, and a first run with a plain model."""
    folder = tmp_path_factory.mktemp("humid")
    recipe = inquiries.recipe_file(folder)
    text = recipe.read_text(encoding="utf-8")
    more = "settle_s = 60.0\nverification = [[35.0, 15.0], [110.0, 200.0], [70.0, -130.0]]\n"
    recipe.write_text(text + more, encoding="utf-8")
    station = inquiries.station_file(folder, "moisture_swelling", swelling=2e-3)
    text = station.read_text(encoding="utf-8")
    assert load_station().devices.reader.profile == "tumbleline_reader"
    station.write_text(text.replace('"tumbleline_reader"', '"tumbleline_reader_humidity"'), encoding="utf-8")
    assert told(folder, "run", str(recipe), "--station", str(station), "--direct")["run"]
    return folder


def told(folder: Path, command: str, *more: str, archive: bool = True) -> dict:
    where = ["--archive", str(folder / "archive")] if archive else []
    done = CliRunner().invoke(app, [command, *more, *where, "--json"])
    assert done.exit_code in (0, 1), done.output
    return json.loads(done.stdout)


def left_ug(folder: Path, run: str) -> float:
    """Root mean square of what the fit leaves, µg."""
    return float(np.sqrt(np.mean(Archive(folder / "archive").run(run).table("residuals")["residual_ug"] ** 2)))


@pytest.mark.slow
def test_what_the_reader_records_is_in_readings_and_dwells(line: Path) -> None:
    run = Archive(line / "archive").run("latest")
    readings, dwells = run.table("readings"), run.table("dwells")
    assert np.ptp(dwells["humidity_pct"]) > 2.0
    own = readings[readings["kind"] != "allan"].set_index(["unit", "record"])["humidity_pct"]
    kept = dwells.set_index(["unit", "record"])["humidity_pct"]
    np.testing.assert_array_equal(kept, own.loc[kept.index])


@pytest.mark.slow
def test_the_loop_closes(line: Path) -> None:
    assert told(line, "diagnose", "latest")["recommended"] == [HUMID]
    model = line / "line.toml"
    extended = told(line, "extend", str(model), HUMID, "--effects", ",".join(MODEL), archive=False)
    assert extended["effects"] == [*MODEL, HUMID]
    first = Archive(line / "archive").run("latest").id
    recipe = (line / "ambiguous.toml").read_text(encoding="utf-8")
    again = line / "again.toml"
    plain = 'effects = ["bias", "scale", "misalignment"]'
    again.write_text(recipe.replace(plain, 'model = "line.toml"'), encoding="utf-8")
    second = told(line, "run", str(again), "--station", str(line / "station.toml"), "--repeat", "1", "--direct")["run"]
    assert left_ug(line, second) < 0.2 * left_ug(line, first)
    assert HUMID not in told(line, "diagnose", second)["recommended"]
    compared = told(line, "compare", first, "--effects", ",".join([*MODEL, HUMID]))
    assert compared["rms_ug"] < 0.2 * told(line, "compare", first)["rms_ug"]
    renewed = told(line, "rerun", first, "--model", str(model))
    assert left_ug(line, renewed["runs"][0]["new"]) < 0.2 * left_ug(line, first)
    assert told(line, "whatif", str(model), first)["verdict"] == "better"


def test_a_model_with_a_column_that_the_station_does_not_record_is_refused_before_anything_moves(
    tmp_path: Path,
) -> None:
    recipe = inquiries.recipe_file(tmp_path)
    text = recipe.read_text(encoding="utf-8")
    recipe.write_text(text.replace('"misalignment"]', f'"misalignment", "{HUMID}"]'), encoding="utf-8")
    done = CliRunner().invoke(app, ["run", str(recipe), "--direct", "--archive", str(tmp_path / "nothing")])
    assert isinstance(done.exception, RecipeInvalid)
    assert "humidity_pct" in str(done.exception)
    assert not list((tmp_path / "nothing").glob("captures/*"))
