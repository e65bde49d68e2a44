"""What README, guides and explanations tell is so: commands, options, targets of make, files, figures, pictures."""

import hashlib
import json
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import printed_pages as pages
import pytest
from capture_double import finished_run
from each import each
from in_process import document_of, given
from printed_pages import ROOT

from inertial import frames, poses
from inertial.planning.reasons import reason
from inertial.state import State
from pipelines.audit.rules import Rules, load_rules
from pipelines.audit.sql import VIEWS
from pipelines.demo.scenes import SCENES
from pipelines.importers.exchange import read_dwells
from pipelines.jobs.recipes import load_limits, load_recipe
from pipelines.jobs.seating import Seating, read_seating
from pipelines.procedures import PROCEDURES, figures_of_recipe, parts_of, refuse_unusable
from schemas.profile import Profile
from schemas.recipe import RecipeFile
from schemas.safety import Safety, SelfTest, Suspenders
from schemas.station import load_station
from schemas.station_devices import Device
from schemas.toml_files import parse_as
from stations.devices.adapters import adapter_of, adapters
from stations.devices.chamber import ThermalChamber
from stations.plant.hidden import HIDDEN
from stations.plant.physics import Sampler
from stations.plant.preset import load_preset
from stations.self_test import NOISIER, SIGMAS

PAGES = [page for page in pages.PAGES if "deploy" not in page.parts] + [ROOT / "CONTRIBUTING.md"]
BENCHMARKS = ROOT / "benchmarks" / "README.md"
PLAN_PAGE = pages.text("docs/explanation/identifiability.md")
PLANS = [line for block in re.findall(r"```\n(.*?)```", PLAN_PAGE, re.DOTALL) for line in block.strip().splitlines()]
POSES, DEVICES = pages.text("docs/how-to/choose-poses.md"), pages.text("docs/how-to/add-a-device.md")
PRINTED = re.findall(
    r"^\$ tumbleline run (deploy/recipes/procedures/\S+)$", pages.text("docs/how-to/list-procedures.md"), re.MULTILINE
)


def read(page: Path) -> str:
    return page.read_text(encoding="utf-8")


@each([*PAGES, BENCHMARKS])
def test_what_a_page_names_is_there(page: Path) -> None:
    text = read(page)
    targets = set(re.findall(r"^([a-z-]+):", read(ROOT / "Makefile"), re.MULTILINE))
    assert set(re.findall(r"(?:^ {4}|`)make ([a-z-]+)", text, re.MULTILINE)) <= targets
    for name, arguments in re.findall(r"benchmarks/(\w+)\.py((?: --?[\w-]+(?: [\w.]+)?)*)", text):
        source = read(ROOT / "benchmarks" / f"{name}.py")
        assert [word for word in re.findall(r"--[\w-]+", arguments) if f'"{word}"' not in source] == []
    named = re.findall(r"`((?:inertial|stations|schemas|pipelines|deploy|tests|docs)/[\w./-]+\.\w+)`", text)
    assert [name for name in named if not (ROOT / name).exists()] == []
    hidden = set(re.findall(r"demo .*--effect (\w+)", text))
    assert hidden <= {"random"} | {scene.kind for scene in SCENES} | {scene.effect for scene in SCENES}


def test_files_of_the_guide_to_running_a_lot_are_files(tmp_path: Path) -> None:
    guide = pages.text("docs/how-to/run-a-lot.md")
    (recipe,) = (block for block in pages.blocks("docs/how-to/run-a-lot.md", "toml") if "poses" in block)
    assert parse_as(RecipeFile, recipe, "guide").units == ["SN1", "SN2"]
    (tmp_path / "my.toml").write_text(recipe, encoding="utf-8")
    assert load_limits(load_recipe(str(tmp_path / "my.toml")), tmp_path).name == "consumer"
    assert "a first line slot,serial, then 0,SN1" in guide
    assert '[slots] with lines like 0 = "SN1"' in guide
    for name, text in (("lot-17.csv", "slot,serial\n0,SN1\n"), ("lot-17.toml", '[slots]\n0 = "SN1"\n')):
        (tmp_path / name).write_text(text, encoding="utf-8")
        assert read_seating(str(tmp_path / name)) == Seating(("SN1",), (0,))
    for slots in (16, 32):
        assert f"simulated-{slots}.toml" in guide
        assert load_station(ROOT / "deploy" / "stations" / f"simulated-{slots}.toml").devices.slots.count == slots


def test_rules_and_views_of_the_guide_to_audits_are_those_of_the_program(tmp_path: Path) -> None:
    page = "docs/how-to/audit.md"
    (tmp_path / "rules.toml").write_text(pages.blocks(page, "toml")[0], encoding="utf-8")
    rules = load_rules(tmp_path / "rules.toml")
    assert (rules.interval, rules.months("ADXL355"), rules.is_standard("REF-01")) == ("drift", 9, True)
    assert [key for key in Rules.model_fields if key not in pages.text("pipelines/audit/default.toml")] == []
    table = pages.text(page).partition("| view |")[2].partition("`query` needs the extra")[0]
    assert set(re.findall(r"`(\w+)`", table)) - {"run"} <= set(VIEWS)


def test_profile_and_links_of_the_guide_to_devices_are_such() -> None:
    profile = parse_as(Profile, pages.blocks("docs/how-to/add-a-device.md", "toml")[0], "guide")
    assert [register.name for register in profile.registers] == ["temperature", "set_point"]
    assert adapter_of(profile, "chamber", ThermalChamber) is adapters()["set_point"]
    blocks = re.findall(r"```toml\n(\[devices.*?)```", DEVICES, re.DOTALL)
    links = [Device.model_validate(next(iter(tomllib.loads(text)["devices"].values()))) for text in blocks]
    assert [(device.link, device.missing()) for device in links] == [("rtu", ""), ("tls", "")]


def test_figures_of_the_station_and_of_its_safety_are_those_of_the_text() -> None:
    text = pages.text("docs/explanation/simulated-station.md")
    assert [kind for kind in HIDDEN if f"`{kind}`" not in text] == []
    forms = ("int20x3", "int24x3", "int24x1")
    assert [Sampler(None, 1, form, 48000).capacity for form in forms] == [12000, 9600, 24000]
    qa700 = load_preset("QA700")
    assert round(1e6 * qa700.lsb / qa700.scale, 1) == 3.9
    told = tomllib.loads("\n".join(pages.blocks("docs/explanation/station-safety.md", "toml")))
    for name, kind in (("suspenders", Suspenders), ("safety", Safety)):
        assert kind.model_validate(told[name]) == kind()
        unsaid = set(kind.model_fields) - set(told[name])
        assert [key for key in unsaid if f"# {key} = " not in pages.text("docs/explanation/station-safety.md")] == []
    check = "docs/how-to/daily-station-check.md"
    own = SelfTest.model_validate(tomllib.loads("\n".join(pages.blocks(check, "toml")))["self_test"])
    assert own.standard == "CS-01"
    assert own.model_copy(update={"standard": ""}) == SelfTest()
    assert f"`history_min` = {own.history_min}" in pages.text(check)
    assert (NOISIER, SIGMAS) == (3.0, 3.0)


def planned(plan: str) -> State:
    outer, inner = np.radians(poses.plan(plan)).T
    time, warm = 12.0 * np.arange(len(outer)), np.full(len(outer), 25.0)
    return State(frames.force_from_angles(outer, inner), time, warm, warm, outer=outer, inner=inner)


def test_the_sentence_and_the_table_of_the_guide_to_poses_hold() -> None:
    plain = ("bias", "scale", "misalignment")
    quoted = re.search(r"\*(β in 90° steps.*?)\*", POSES)
    assert quoted is not None
    assert reason(planned("orthogonal24"), "cross_coupling", plain) == quoted[1]
    wanted = {
        ("six", "second_order"): True, ("six", "cross_coupling"): False, ("six", "third_order"): False,
        ("twelve", "third_order"): False, ("eighteen", "third_order"): True, ("eighteen", "cross_coupling"): True,
    }  # fmt: skip
    assert {key: not reason(planned(key[0]), key[1], plain) for key in wanted} == wanted


def test_every_procedure_with_figures_has_a_sample_recipe_that_the_built_in_station_can_perform() -> None:
    kinds = [kind for printed in PRINTED for kind in [part.kind for part in parts_of(load_recipe(str(ROOT / printed)))]]
    assert set(kinds) == {name for name, one in PROCEDURES.items() if one.figures}
    assert len(kinds) == len(PRINTED)
    for kind, printed in zip(kinds, PRINTED, strict=True):
        recipe = load_recipe(str(ROOT / printed))
        assert Path(printed).stem.startswith(kind)  # a kind that has several profiles has a recipe for each
        refuse_unusable(recipe, load_station())
        assert set(load_limits(recipe, (ROOT / printed).parent).figures) <= set(figures_of_recipe(recipe))


@pytest.mark.slow
@each([line for line in PLANS if "optimise" not in line])
def test_a_plan_of_the_page_on_identifiability_is_made(line: str, home: Path) -> None:
    words = shlex.split(line.replace("deploy/", f"{ROOT}/deploy/"))
    assert words[:2] == ["tumbleline", "plan"]
    assert given(*words[1:])[0] == 0


@pytest.mark.slow
def test_the_plan_of_the_page_that_tells_rivals_apart_finds_what_it_says(home: Path) -> None:
    (line,) = [line for line in PLANS if "--criterion T" in line]
    document = json.loads(given(*shlex.split(line)[1:], "--json")[1])
    found = min(row["chi_square"] for row in document["rivals"])
    assert found >= 50.0
    assert max(row["textbook"] for row in document["rivals"]) < 1e-3
    match = re.search(r"(\d+) dwells of 2 s at 25 °C in (\d+) % of its time, gives χ² (\d+)", PLAN_PAGE)
    assert match is not None
    assert document["dwells"] == pytest.approx(int(match[1]), abs=4)
    assert 100.0 * document["share"] == pytest.approx(int(match[2]), abs=1.0)
    assert found == pytest.approx(float(match[3]), rel=0.2)


def test_pictures_of_pages_are_there_small_and_need_no_network(tmp_path: Path) -> None:
    pictures = ROOT / "docs" / "pictures"
    shown = re.findall(r"\]\(\.\./pictures/(.*?)\)", PLAN_PAGE)
    assert len(shown) == 4
    assert [name for name in shown if (pictures / name).stat().st_size >= 150_000] == []
    operator = pages.text("docs/how-to/operate-the-line.md")
    for name, part in (("operator-run", "station"), ("operator-result", "SN1")):
        assert f"../pictures/{name}.svg" in operator
        assert part in read(pictures / f"{name}.svg")
        assert 'url("http' not in read(pictures / f"{name}.svg")
    assert given("plan", "production", "--output", tmp_path, "--json")[0] == 0
    drawn = sorted(path.name for path in tmp_path.iterdir())
    assert drawn == [f"production-{name}.svg" for name in ("aliases", "budget", "sights", "sphere", "temperature")]
    assert all(read(path).startswith("<svg") for path in tmp_path.iterdir())


@pytest.mark.slow
def test_the_pictures_of_the_guide_to_poses_are_as_they_are_drawn(tmp_path: Path) -> None:
    script = tmp_path / "docs" / "choose_poses.py"
    script.parent.mkdir()
    script.write_text(pages.text("docs/pictures/choose_poses.py"), encoding="utf-8")
    subprocess.run([sys.executable, str(script)], check=True, capture_output=True)
    names = re.findall(r"\.\./pictures/(\S+\.svg)", POSES)
    assert [name for name in names if read(script.parent / name) != pages.text(f"docs/pictures/{name}")] == []


def test_the_reference_names_every_place_and_key_of_an_archive(tmp_path: Path) -> None:
    page = pages.text("docs/reference/archive.md")
    keys = finished_run(tmp_path).manifest("coefficients").keys() | {"signature", "taken_from"}
    assert {key for key in keys if f"`{key}`" not in page} == set()
    top = {path.name for path in (tmp_path / "archive").iterdir() if path.is_dir()}
    assert {name for name in top if f"`{name}/" not in page} == set()


@pytest.mark.slow
def test_the_mapping_file_of_the_guide_to_imports_does_what_its_options_do(shared_data: Path, home: Path) -> None:
    page = "docs/how-to/import-your-data.md"
    (content,) = (block for block in pages.blocks(page, "toml") if "[columns]" in block)
    (home / "mapping.toml").write_text(content, encoding="utf-8")
    (tumble,) = (command for command, _ in pages.examples(page) if "xsens_acc" in command and " import " in command)
    by_options = document_of(*shlex.split(tumble.replace("$DATA", str(shared_data)))[1:])
    file = shared_data / "xsens-tumble" / "xsens_acc.mat.gz"
    by_file = document_of("import", file, "--set", "mapping.toml", "--fit", "norm")
    assert json.dumps(by_file) == json.dumps(by_options)
    assert by_file["source"]["sha256"] == hashlib.sha256(file.read_bytes()).hexdigest()
    assert len(read_dwells(by_file["run"])) == by_file["dwells"] == 38
    # 1.0 mm/s² without weights was published, 1.1 with the noise of each dwell
    assert by_options["adequate"] is True
    assert by_options["error"]["rms_ug"] < 112.0
    shown = document_of("show", by_options["run"], "coefficients")
    assert {row["effect"] for row in shown["rows"]} == {"bias", "scale", "misalignment"}
    (chamber,) = (c for c, _ in pages.examples(page) if "imu_raw_data" in c and "--fit temperature" in c)
    words = shlex.split(chamber.replace("m/s^2", "g").replace("$DATA", str(shared_data)))[1:]
    status, out, err = given(*words, "--archive", "none")
    assert (status, out, "looks like m/s^2" in err) == (2, "", True)
    assert not (home / "none").exists()
