"""What README, guides and explanations tell is so: commands, options, targets of make, files, figures, pictures."""

import hashlib
import json
import re
import shlex
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
from pipelines.procedures import PROCEDURES, figures_of_recipe, parts_of, refuse_unusable
from schemas.station import load_station

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


def test_rules_and_views_of_the_guide_to_audits_are_those_of_the_program(tmp_path: Path) -> None:
    page = "docs/how-to/audit.md"
    (tmp_path / "rules.toml").write_text(pages.blocks(page, "toml")[0], encoding="utf-8")
    rules = load_rules(tmp_path / "rules.toml")
    assert (rules.interval, rules.months("ADXL355"), rules.is_standard("REF-01")) == ("drift", 9, True)
    assert [key for key in Rules.model_fields if key not in pages.text("pipelines/audit/default.toml")] == []
    table = pages.text(page).partition("| view |")[2].partition("`query` needs the extra")[0]
    assert set(re.findall(r"`(\w+)`", table)) - {"run"} <= set(VIEWS)


def test_the_sentence_of_the_guide_to_poses_is_what_is_said() -> None:
    outer, inner = np.radians(poses.plan("orthogonal24")).T
    time, warm = 12.0 * np.arange(len(outer)), np.full(len(outer), 25.0)
    state = State(frames.force_from_angles(outer, inner), time, warm, warm, outer=outer, inner=inner)
    quoted = re.search(r"\*(β in 90° steps.*?)\*", pages.text("docs/how-to/choose-poses.md"))
    assert quoted is not None
    assert reason(state, "cross_coupling", ("bias", "scale", "misalignment")) == quoted[1]


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


def test_the_pictures_of_a_plan_are_drawn(tmp_path: Path) -> None:
    assert given("plan", "production", "--output", tmp_path, "--json")[0] == 0
    drawn = sorted(path.name for path in tmp_path.iterdir())
    assert drawn == [f"production-{name}.svg" for name in ("aliases", "budget", "sights", "sphere", "temperature")]
    assert all(read(path).startswith("<svg") for path in tmp_path.iterdir())


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
