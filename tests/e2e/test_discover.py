"""Discoveries as a user makes them: an archive with attributes, one explained, a demonstration, refusals."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from demonstrations import wafer_line
from each import each
from in_process import document_of, given, refused, text_of
from typed_commands import printed_commands

import tumbleline
from inertial.frames import force_from_angles
from pipelines.archive import Archive
from pipelines.demo.archive_lots import Hidden, Line, write_lots
from pipelines.discovery.lot_source import DiscoveryArchive
from pipelines.discovery.nights import discovered_before


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A line whose archive hides a softening spring in one wafer, with the wafers as attributes; it was looked at once."""
    place = tmp_path_factory.mktemp("line")
    made = wafer_line(place)
    text_of("attributes", "add", made.units, "--archive", made.folder)
    (row,) = document_of("discover", "--archive", made.folder, "--workers", "1")["new"]
    assert row == "D1"
    return place


@pytest.mark.slow  # of fewer lots with a larger effect: the tests below
def test_the_demonstration_finds_the_wafer_and_its_evidence_goes_with_the_effect(tmp_path: Path) -> None:
    said = document_of("demo", "--lots", "110", "--seed", "4", "--folder", tmp_path / "line", status=0)
    assert said["found"]
    assert said["wafer_named"]
    (row,) = said["discoveries"]
    assert row["size_floors"] < 0.05  # no single lot could show it
    (compared,) = said["compared"]
    assert compared["log_e_after"] < 0.5 * compared["log_e_before"]
    assert compared["size_ug_after"] < 0.3 * compared["size_ug_before"]


def test_a_discovery_is_new_once_and_is_explained(folder: Path, tmp_path: Path) -> None:
    archive = folder / "archive"
    page = tmp_path / "d.html"
    assert document_of("discover", "--archive", archive, "--html", page)["new"] == []
    html = page.read_text("utf-8")
    assert "third_order" in html
    assert "<svg" in html
    assert "http" not in html.replace("http://www.w3.org", "")
    _, text, _ = given("discover", "--archive", archive)
    assert "differs by wafer" in text
    (line,) = printed_commands(text)
    assert line == ["discover", "--archive", str(archive), "--explain", "D1"]
    assert given(*line)[0] == 0
    document_of("discover", "--explain", "D1", "--archive", archive, status=0)
    assert "of the sensors" in text_of("discover", "--explain", "d1", "--archive", archive, status=0)
    only = document_of("discover", "--driver", "slot", "--archive", archive)
    assert (only["discoveries"], [one["name"] for one in only["drivers"]]) == ([], ["slot"])


def test_an_effect_of_a_model_file_takes_its_discovery_away(folder: Path, tmp_path: Path) -> None:
    model = tmp_path / "m.toml"
    effects = '["bias", "scale", "misalignment", "bias_temperature", "scale_temperature", "third_order"]'
    model.write_text(f'[model]\nname = "m"\nversion = 1\neffects = {effects}\n', encoding="utf-8")
    found = document_of("discover", "--model", model, "--archive", folder / "archive")
    assert "third_order" in found["model"]
    assert found["discoveries"] == []
    assert found["compared"][0]["log_e_after"] < found["compared"][0]["log_e_before"]
    nights = folder / "archive" / "discovery" / "DEMO" / "nights"
    assert len(list(nights.iterdir())) == 1  # what is in memory only is not kept


def test_the_archive_is_verified_its_evidence_is_in_order_of_arrival_and_python_and_audit_tell_the_same(
    folder: Path,
) -> None:
    archive = Archive(str(folder / "archive"))
    (wafer,) = document_of("attributes", "list", "--archive", archive.root)["attributes"]
    assert (wafer["attribute"], wafer["known"], wafer["levels"]) == ("wafer", 352, 4)
    nights = folder / "archive" / "discovery" / "DEMO" / "nights"
    (entry,) = [json.loads(place.read_bytes()) for place in nights.iterdir()]
    assert entry["runs"] == DiscoveryArchive(archive).pooled()
    assert entry["alarms"]
    (row,) = tumbleline.archive(folder / "archive").discoveries().to_dict("records")
    assert (row["id"], row["driver"]) == ("D1", "wafer")
    assert discovered_before(archive) == [("DEMO", 1)]


REFUSED = {
    "--device ADXL355": "--device 'ADXL355' has no run",
    "--driver wafr": "no driver is called 'wafr'; did you mean wafer?",
    "--since 2026-3-1": "--since is '2026-3-1', a day as 2026-03-14 is needed",
    "--since 2030-01-01": "no lot of DEMO was measured since 2030-01-01",
    "--explain D9": "no discovery is called 'D9'",
}


@each(REFUSED)
def test_refusals_say_what_is_there(words: str, folder: Path) -> None:
    assert REFUSED[words] in refused("discover", *words.split(), "--archive", folder / "archive")


def test_what_cannot_be_judged_is_said(tmp_path: Path) -> None:
    assert "--lots takes no name" in refused("demo", "pendulous_mass", "--lots", "60")
    Archive(str(tmp_path / "archive")).prepare()
    assert "has files already" in refused("demo", "--lots", "400", "--folder", tmp_path)
    assert "no run with dwells, thirty at least" in refused("discover", "--archive", tmp_path / "archive")
    assert "holds no archive" in refused("discover", "--archive", tmp_path / "nothing")
    assert "there is no file" in refused("attributes", "add", tmp_path / "u.csv", "--archive", tmp_path / "archive")
    (tmp_path / "u.csv").write_text("wafer\nW1\n", encoding="utf-8")
    add = ("attributes", "add", tmp_path / "u.csv", "--archive", tmp_path / "archive")
    assert "no column 'serial'" in refused(*add)
    assert "--by is 'lot'" in refused(*add, "--by", "lot")


@pytest.mark.slow
def test_the_demonstration_for_people_ends_with_a_command_that_runs(tmp_path: Path) -> None:
    status, out, err = given("demo", "--lots", "60", "--seed", "4", "--folder", tmp_path / "few")
    assert status == 0, err
    words = out.strip().splitlines()[-1].split()
    assert words[:2] == ["tumbleline", "discover"]
    assert given(*words[1:])[0] in {0, 1}
    assert (tmp_path / "few" / "discoveries.html").is_file()


@pytest.mark.slow
def test_what_no_effect_is_like_is_said_with_its_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the devices of one wafer the sensitive axis turns with the square of its load."""

    def twisted(force: np.ndarray, twist: float) -> np.ndarray:
        return force + np.sin(twist * force**2) * np.roll(force, -1, axis=1)

    monkeypatch.setattr("pipelines.demo.archive_lots._deflection", twisted)
    made = write_lots(tmp_path, Line(9, hidden=Hidden("W02", 150e-6), wafers=4), 44)
    text_of("attributes", "add", made.units, "--archive", made.folder)
    page = tmp_path / "d.html"
    options = ("discover", "--archive", made.folder, "--workers", "1")
    said = document_of(*options, "--html", page, status=1)
    (row,) = said["unexplained"]
    assert (said["discoveries"], row["driver"], row["level"]) == ([], "wafer", "W02")
    assert said["new"] == [row["id"]]  # an alarm as that of any other discovery
    outer, inner, left, error = np.array(row["map"]).T
    force = force_from_angles(np.radians(outer), np.radians(inner))
    function = 150.0 * force**2 * np.roll(force, -1, axis=1)
    linear = np.column_stack([np.ones(len(force)), force])
    expected = (function - linear @ np.linalg.lstsq(linear, function, rcond=None)[0])[:, "xyz".index(row["axes"][0])]
    share = float(left @ expected / (expected @ expected))  # less what the mean of all wafers has of it
    assert 0.6 < share < 1.1
    assert np.sqrt(np.mean(((left - share * expected) / error) ** 2)) < 2.0
    again = document_of(*options, status=0)
    assert (again["unexplained"], again["new"]) == (said["unexplained"], [])  # as found the night before
    assert "no effect of the catalogue explains it" in page.read_text("utf-8")
    (line,) = printed_commands(text := given(*options)[1])
    assert "differs by wafer, most in W02" in text
    assert "has the largest evidence" in text_of(*line, status=0)
    assert discovered_before(Archive(str(made.folder))) == [("DEMO", 1)]


@pytest.mark.slow
def test_a_thermometer_that_is_off_in_one_soak_is_no_effect_of_the_sensors(tmp_path: Path) -> None:
    """It reads 0.4 K too much in the cold; the devices' biases follow their temperature by 40 µg/K rms, either way."""

    class Misread(Line):
        def lot(self, station: str) -> tuple[pd.DataFrame, pd.DataFrame]:
            dwells, about = super().lot(station)
            dwells.loc[dwells["chamber_C"] < 0.0, "unit_C"] += 0.4
            return dwells, about

    made = write_lots(tmp_path, Misread(19, hidden=None), 50)
    options = ("discover", "--archive", made.folder, "--workers", "1")
    said = document_of(*options)
    (row,) = said["discoveries"]
    assert (row["driver"], row["scope"], row["kind"]) == ("own temperature coefficient", "thermometer", "slope")
    assert "bias_temperature_quadratic" in row["effects"]
    # 0.4 K in a third of the dwells, less what the linear coefficient takes of it, times 40 µg/K
    assert row["interval_ug"][0] < 0.4 * 40.0 * np.sqrt(6.0) / 6.0 / np.sqrt(3.0) < row["interval_ug"][1]
    explained = text_of(*options, "--explain", row["id"])
    assert "of the thermometer" in explained
    assert "confirmed" not in explained
