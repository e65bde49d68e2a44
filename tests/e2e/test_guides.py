"""README and guides: their commands print what stands below them; files, rules, figures and pictures are as they tell."""

import hashlib
import json
import re
import shlex
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import printed_pages as pages
import pytest
from capture_double import finished_run, small_run
from demonstrations import demonstrations_measured_once
from each import each
from in_process import document_of, given
from long_suites import mostly_slow
from printed_pages import ROOT

from benchmarks.generated_archive import write_archive
from pipelines.audit.rules import Rules, load_rules
from pipelines.audit.sql import VIEWS
from pipelines.demo.scenes import SCENES
from pipelines.importers.exchange import read_dwells
from pipelines.jobs.recipes import load_limits, load_recipe
from pipelines.procedures import PROCEDURES, figures_of_recipe, parts_of, refuse_unusable
from schemas.station import load_station

MODEL = """
[model]
name = "third"
version = 1
effects = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature", "third_order"]
"""


def nothing(_page: str) -> None:
    """A page whose commands need nothing."""


def line(_page: str) -> None:
    run = finished_run(Path.cwd())
    Path("sent-by-mail.parquet").write_bytes((run.path / "grades.parquet").read_bytes())


def factory(page: str) -> None:
    """The archive of a factory, and the rules of the page."""
    write_archive(Path("archive"), 16, years=1.0, seed=7, workers=1)
    Path("rules.toml").write_text(pages.blocks(page, "toml")[0], encoding="utf-8")


def old_runs(_page: str) -> None:
    small_run(Path.cwd())
    Path("model.toml").write_text(MODEL, encoding="utf-8")


def game(_page: str) -> None:
    """A model with the effect that the page takes out."""
    Path("game").mkdir()
    given("extend", "game/model.toml", "cross_coupling", "--effects", "bias,scale,misalignment")


def positions(page: str) -> None:
    Path("positions.csv").write_text(pages.blocks(page, "csv")[0], encoding="utf-8")


def glue(page: str) -> None:
    """The model and the effect of the page, and dwells of a device whose glue follows the humidity late."""
    rng = np.random.default_rng(20260101)
    Path("line.toml").write_text(pages.blocks(page, "toml")[0], encoding="utf-8")
    Path("swelling_glue.py").write_text(pages.blocks(page, "python")[0], encoding="utf-8")
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


@dataclass(frozen=True)
class Guide:
    """A page, what its commands need, the share by which numbers may differ, and what of it is not run here.

    files : parts of files that are there afterwards; empty where the file alone counts
    """

    page: str
    prepare: Callable[[str], None] = nothing
    close: float = 0.0
    left_out: tuple[str, ...] = ()
    files: tuple[tuple[str, str], ...] = ()


GUIDES = [
    Guide("docs/tutorial/from-a-spreadsheet.md", positions, close=0.05, files=(("positions.html", "<svg"),)),
    Guide("docs/how-to/audit-a-laboratory.md", line, files=(("audit.html", "<svg"),)),
    Guide(
        "docs/how-to/export.md", line,
        files=(("A1.params", "CAL_ACC0_ID\t1310988\t6"), ("calibration.h", "per_count"), ("parameters/A3.param", "")),
    ),
    Guide("docs/how-to/trace-a-certificate.md", line),
    # measured by tests/e2e/test_walk_of_recipes.py, asked by tests/unit/pipelines/doctor/test_examine.py
    Guide("docs/how-to/operate-the-line.md", line, left_out=("run", "doctor")),
    # the demonstration and its improvement are those of tests/e2e/test_models.py
    Guide("docs/how-to/improve-a-model.md", game, left_out=("demo", "improve"), close=0.05),
]  # fmt: skip

SLOW = [
    Guide("docs/how-to/audit.md", factory),  # its commands: tests/e2e/test_audit.py; its rules: below
    Guide(
        "docs/tutorial/find-a-missing-effect.md", close=0.05,
        files=(("game/report.html", "<th>scope</th>"), ("game/history.png", "")),
    ),
    Guide("docs/how-to/add-your-own-effect.md", glue),  # an effect of a file: tests/e2e/test_diagnosis.py
    Guide("docs/how-to/run-an-archive-again.md", old_runs),
    Guide("docs/how-to/release-a-model.md", old_runs),
]  # fmt: skip

ELSEWHERE = {
    "practise-on-a-station": "tests/e2e/test_practice.py",
    "import-your-data": "tests/e2e/test_guides.py",
    "correct-a-recording": "tests/e2e/test_correct.py",
    "README": "tests/e2e/test_guides.py",
    "add-your-own-effect": "tests/e2e/test_guides.py",
    "find-a-missing-effect": "tests/e2e/test_guides.py",
    "issue-a-certificate": "tests/e2e/test_guides.py",
    "program-the-device": "tests/faults/test_programming.py",
}
"""Other pages with printed outputs, and the file with the test that compares them."""


def wrong(command: str, printed: str, close: float) -> str:
    """What is wrong with a command of a page: its status, or what it prints."""
    words = shlex.split(command)[1:]
    runs = sorted(path.name for path in Path("archive/runs").glob("*"))
    places = {"RUN": runs[0], "RE-RUN": runs[-1]} if runs else {}
    status, out, err = given(*(places.get(word, word) for word in words), columns=100)
    if words[0] == "release" and status == 2 and re.search(r"says (no better|worse)", err):
        return ""
    expected = {1 if any(one in printed for one in pages.VERDICTS) else 0} if printed.strip() else {0, 1}
    if status not in expected:
        return f"{command}: status {status}\n{out}{err}"
    shown = out or "\n".join(line for line in err.splitlines() if "files in" in line)
    differs = pages.unlike(shown, printed, close) if printed.strip() else ""
    return f"{command}: {differs}" if differs else ""


@pytest.mark.parametrize(
    "guide",
    [*GUIDES, *(pytest.param(one, marks=pytest.mark.slow) for one in SLOW)],
    ids=lambda one: Path(one.page).stem,
)
def test_the_commands_of_a_guide_print_what_it_says(
    guide: Guide, home: Path, monkeypatch: pytest.MonkeyPatch, no_next_measurement: None
) -> None:
    monkeypatch.setenv("TUMBLELINE_ARCHIVE", "archive")
    demonstrations_measured_once(monkeypatch)
    guide.prepare(guide.page)
    examples = [one for one in pages.examples(guide.page) if one[0].split()[1] not in guide.left_out]
    assert examples
    assert [found for command, printed in examples if (found := wrong(command, printed, guide.close))] == []
    for name, part in guide.files:
        assert (home / name).is_file(), name
        assert not part or part in (home / name).read_text(encoding="utf-8"), name


def test_every_page_that_shows_an_output_is_compared_by_a_test() -> None:
    shown = {page.stem for page in pages.PAGES if any(p.strip() for _, p in pages.examples(str(page)))}
    assert shown == {Path(one.page).stem for one in GUIDES if "audit" not in one.page and "operate" not in one.page} | {
        *ELSEWHERE
    }
    for stem, test in ELSEWHERE.items():
        assert stem in (pages.ROOT / test).read_text(encoding="utf-8"), (stem, test)


IMPORTS = pages.examples("docs/how-to/import-your-data.md")


@pytest.mark.parametrize(("line", "printed"), mostly_slow(IMPORTS, *IMPORTS[:2]), ids=range(len(IMPORTS)))
def test_an_example_of_imports_prints_what_the_guide_says(
    line: str, printed: str, shared_data: Path, home: Path
) -> None:
    pytest.importorskip("idelib" if ".ide " in line else "numpy")
    words = shlex.split(line.replace("$DATA", str(shared_data)))[1:]
    status, out, err = given(*words)
    assert (status, err) == (1 if "NOT ADEQUATE" in printed else 0, "")
    assert not pages.unlike(out.replace(str(shared_data), "$DATA"), printed, 0.0)


@pytest.mark.slow
def test_the_story_of_the_readme_prints_what_it_shows(home: Path) -> None:
    story = [one for one in pages.examples("README.md") if "demo" in one[0]]
    assert [found for command, printed in story if (found := wrong(command, printed, 0.5))] == []


@pytest.mark.slow
def test_the_main_job_prints_what_the_readme_shows(home: Path) -> None:
    block = re.search(r"```\n( +fit +verify.*?)```", pages.text("README.md"), flags=re.DOTALL)
    assert block is not None
    status, out, err = given("run", columns=100)
    assert status == 0, err
    own, told = (re.sub(r"production-\w+", "RUN", one) for one in (out, block[1]))
    assert not pages.unlike(own, f"…{told}…", 0.5)
    verdict = re.search(r"^model +(.*)$", block[1], flags=re.MULTILINE)
    assert verdict is not None
    # the command that the run names says the same
    assert not wrong("tumbleline diagnose latest", f"{verdict[1]}…", 0.5)


@pytest.mark.slow
def test_a_certificate_is_told_as_its_guide_shows(line: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("typst")
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, Encoding
    from cryptography.hazmat.primitives.serialization.pkcs12 import serialize_key_and_certificates
    from signing_keys import made_key

    page = "docs/how-to/issue-a-certificate.md"
    shown = [one for one in pages.examples(page) if one[1].strip()]
    assert [command.split()[1] for command, _ in shown] == ["certificate", "verify"]
    (line / "laboratory.toml").write_text(pages.blocks(page, "toml")[0], encoding="utf-8")
    assert given("certificate", "issue", "latest")[0] == 0
    assert not wrong(*shown[0], 0.5)
    (signed,) = (command for command, _ in pages.examples(page) if "--sign-with" in command)
    key = made_key(ec.generate_private_key(ec.SECP256R1()))
    locked = serialize_key_and_certificates(b"key", key.key, key.certificate, None, BestAvailableEncryption(b"secret"))
    (line / "laboratory.p12").write_bytes(locked)
    (line / "password").write_text("secret\n", encoding="utf-8")
    (line / "laboratory.pem").write_bytes(key.certificate.public_bytes(Encoding.PEM))
    assert not wrong(signed, "", 0.0)
    (line / "received").mkdir()
    for name in ("A1_1.pdf", "laboratory.pem"):
        shutil.copy(name, "received")
    monkeypatch.chdir("received")  # where no archive is
    assert not wrong(*shown[1], 0.5)


PAGES = [page for page in pages.PAGES if "deploy" not in page.parts] + [ROOT / "CONTRIBUTING.md"]
BENCHMARKS = ROOT / "benchmarks" / "README.md"
PLAN_PAGE = pages.text("docs/explanation/identifiability.md")
PLANS = [line for block in re.findall(r"```\n(.*?)```", PLAN_PAGE, re.DOTALL) for line in block.strip().splitlines()]
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
