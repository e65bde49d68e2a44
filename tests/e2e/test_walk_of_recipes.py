"""What ships works at the first try: recipes and stations of ``deploy``, and every example of every ``--help`` as printed."""

import io
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import threading
from contextlib import chdir
from itertools import product
from pathlib import Path

import pytest
from each import each
from help_examples import examples, made_in, words_of
from in_process import command
from typed_commands import printed_commands

from pipelines.archive.signatures import VARIABLE
from pipelines.cli import INTERRUPTED
from schemas.errors import DONE, PART_FAILED, UNUSABLE
from schemas.station import load_station
from schemas.toml_files import parse_toml

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "deploy"
QUICKEST = DEPLOY / "recipes" / "line-six.toml"
RECIPES = sorted(path for path in (DEPLOY / "recipes").glob("*.toml") if not path.name.endswith(".limits.toml"))
PROCEDURES = sorted(
    path for path in (DEPLOY / "recipes" / "procedures").glob("*.toml") if not path.name.endswith(".limits.toml")
)
STATIONS = sorted((DEPLOY / "stations").glob("*.toml"))


def named(path: Path) -> str:
    return path.stem


def went(*words: object, allowed: tuple[int, ...] = (0,)) -> tuple[str, str]:
    """Standard output and standard error of a command, which ended with one of these statuses and is no defect."""
    done = command([*map(str, words)], columns=2000)
    assert done.returncode in allowed, (words, done.returncode, done.stderr)
    assert "defect" not in done.stderr, done.stderr
    return done.stdout, done.stderr


def pasted(text: str, archive: Path, *, also_quoted: bool = False) -> int:
    lines = printed_commands(text)
    if also_quoted:
        lines += [[*shlex.split(line), "--archive", str(archive)] for line in re.findall(r"'tumbleline ([^']*)'", text)]
    for words in lines:
        out, _ = went(*words, allowed=(0, PART_FAILED))
        assert out.strip(), words
    return len(lines)


QUICK = ("tilt",)
"""Procedures of the fast part; on simulated units each is measured by ``tests/contract/test_procedures.py``."""


@pytest.mark.parametrize(
    "recipe",
    [pytest.param(one, marks=[] if named(one) in QUICK else [pytest.mark.slow]) for one in PROCEDURES],
    ids=named,
)
def test_a_procedure_is_planned_measured_reported_and_says_what_it_lacks(recipe: Path, tmp_path: Path) -> None:
    archive = ("--archive", tmp_path / "archive")
    content = parse_toml(recipe.read_text(encoding="utf-8"), recipe.name)
    kind, limits = content["procedures"][0]["kind"], recipe.with_name(content["limits"])
    out, err = went("plan", recipe)
    assert "min of station time" in out
    assert "refuses this recipe" not in err
    limited = re.findall(r"^(\w+) = \{", limits.read_text(encoding="utf-8"), re.MULTILINE)
    assert limited
    for figure in (kind, *limited):
        assert figure in " ".join(out.split())
    out, _ = went("run", recipe, "--direct", *archive)
    assert re.search(r"\b([12]) of \1 passed", out)
    assert Path(went("show", "latest", "--report", *archive)[0].strip()).is_file()
    if kind == "tilt":  # it has a figure and no result that a certificate is of
        _, err = went("certificate", "issue", "latest", *archive, allowed=(UNUSABLE,))
        assert "nothing to certify" in err
    for words in (("export",), ("diagnose",), ("compare",), ("correct", QUICKEST, "latest")):
        _, err = went(*words, *(() if words[0] == "correct" else ("latest",)), *archive, allowed=(UNUSABLE,))
        assert f"it measured {kind}" in err
        given = pasted(err, tmp_path / "archive", also_quoted=words[0] == "diagnose")
        assert given == (2 if words[0] == "diagnose" else 0)


@pytest.mark.slow
@each(product((*PROCEDURES, *RECIPES), STATIONS), lambda case: " on ".join(map(named, case)))
def test_a_recipe_can_be_planned_on_every_station_or_is_refused_by_name(case: tuple[Path, Path]) -> None:
    planned_or_refused(*case)


def planned_or_refused(recipe: Path, station: Path) -> None:
    """What a station cannot do is said before it moves: by the plan, with a reason."""
    _, err = went("plan", recipe, "--station", station, allowed=(0, PART_FAILED, UNUSABLE))
    for line in err.splitlines():
        assert line.startswith(("warning: 'tumbleline run' refuses this recipe: ", "tumbleline: ")), line


SIMULATED = [path for path in STATIONS if load_station(path).kind == "simulated"]
ANALOGUE = DEPLOY / "recipes" / "analogue.toml"


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    ("recipe", "station"),
    [*((recipe, None) for recipe in RECIPES), *((recipe, at) for recipe in (QUICKEST, ANALOGUE) for at in SIMULATED)],
    ids=lambda path: path.stem if path else "built-in",
)
def test_a_recipe_runs_on_the_built_in_station_and_the_quickest_on_every_simulated_one(
    recipe: Path, station: Path | None, tmp_path: Path
) -> None:
    where = ("--station", station) if station else ()
    assert (len(RECIPES), len(PROCEDURES), len(STATIONS)) >= (5, 12, 8)  # there is something to walk
    out, _ = went("run", recipe, *where, "--direct", "--archive", tmp_path, allowed=(0, PART_FAILED))
    assert re.search(r"\d of \d passed, \d failed, 0 refused", out)
    assert pasted(out, tmp_path) >= 1
    went("export", "latest", "--include", "failed", "--archive", tmp_path)


SERVE = ("workbench", "station monitor --port", "station serve", "station replay", "demo --station", "--every")
"""Examples that go on until Ctrl-C: they are started and ended in a process of their own."""

WITH_A_DEVICE = ("station bring-up",)
"""Examples for which a device must be there: tests/e2e/test_bring_up.py."""

LONG = ("demo",)

DIRECT = {"run", "investigate"}
"""Commands that are given with --direct: the orchestrator is tested elsewhere."""

ELSEWHERE = {"run", "investigate", "import"}
"""Commands whose runs are kept in another archive, so that the latest run is the one that the other examples mean."""

OTHERWISE = {
    "tumbleline station operator": "no run waits",  # with one that waits: tests/e2e/test_inquiry.py
    "tumbleline station operator line-six --answer go": "no run waits",
    # the example before it has programmed other units: the simulated station goes on with that lot only
    "tumbleline station program latest --station line-1.toml --format q24 --yes": "it belongs to another station or lot",
    # the example before it has revoked the only certificate
    "tumbleline certificate revoke SN1 2 --reason 'reference out of date'": "has no calibration that holds",
    # the example of the what-if stands below it
    "tumbleline release model.toml --since 2026-01-01 --reason 'the error on fresh runs falls'": "a what-if is needed",
    # the recipe of the folder is measured to its end
    "tumbleline plan order my.toml": "no table [stop]",
    "tumbleline plan order my.toml --output my-first.toml": "no table [stop]",
    "tumbleline station monitor --queue line-1": "PREFECT_API_URL is not set",
    # the lot of the folder was measured at one temperature
    "tumbleline fit latest --limits industrial": "needs effect bias_temperature",
}
"""Examples that end with status 2 here, and words of their message."""


def kept(example: str) -> bool:
    return any(one in example for one in SERVE)


ALL = list(examples())
SHORT = [one for one in ALL if not kept(one) and not any(word in one for word in (*LONG, *WITH_A_DEVICE))]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """The folder of the examples, and what stands there for names of the reader's own."""
    folder = tmp_path_factory.mktemp("examples")
    with pytest.MonkeyPatch.context() as patch, chdir(folder):
        _at_home(patch, folder)
        names = made_in(folder)
        assert command(["certificate", "issue", "latest"]).returncode == DONE
    return folder, names


def _at_home(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.delenv(VARIABLE, raising=False)  # the key is that of the folder
    for variable, name in (("XDG_STATE_HOME", "state"), ("XDG_CONFIG_HOME", "config"), ("PREFECT_HOME", "prefect")):
        patch.setenv(variable, str(folder / name))


def test_the_examples_are_found_and_every_exception_is_one_of_them() -> None:
    assert len(ALL) > 90
    assert set(OTHERWISE) <= set(SHORT)
    for one in (*SERVE, *LONG):
        assert any(one in example for example in ALL), one


@pytest.mark.slow  # that each exists and is parsed: tests/contract/test_commands.py
@pytest.mark.timeout(900)
def test_the_examples_of_every_help_end_with_a_result(
    world: tuple[Path, dict[str, str]], monkeypatch, tmp_path: Path
) -> None:
    """In one test: later examples use what earlier ones made, in a copy of the folder."""
    made, names = world
    folder = tmp_path / "folder"
    shutil.copytree(made, folder)
    names = {name: text.replace(str(made), str(folder)) for name, text in names.items()}
    _at_home(monkeypatch, folder)
    monkeypatch.chdir(folder)
    wrong: list[tuple[str, int, str]] = []
    for example in SHORT:
        words = words_of(example, names)
        words += ["--direct"] if words[0] in DIRECT else []
        words += ["--archive", "elsewhere"] if words[0] in ELSEWHERE else []
        monkeypatch.setattr(sys, "stdin", io.StringIO("y\n"))
        done = command(words)
        if example in OTHERWISE:
            right = done.returncode == UNUSABLE and OTHERWISE[example] in done.stderr
        else:
            right = done.returncode in {DONE, PART_FAILED}
        if not right or "defect" in done.stderr or "Traceback" in done.stderr:
            wrong.append((example, done.returncode, done.stderr[-400:]))
            continue
        if words[0] in {"extend", "certify"}:
            continue
        for line in printed_commands(done.stdout.partition("Next:")[2]):
            later = command([*line, *(["--direct"] if line[0] in DIRECT else [])])
            if later.returncode not in {DONE, PART_FAILED} or "defect" in later.stderr:
                wrong.append((f"{example}, then {shlex.join(line)}", later.returncode, later.stderr[-400:]))
    assert not wrong, "\n".join(map(str, wrong))


@pytest.mark.slow
@pytest.mark.parametrize("example", [one for one in ALL if kept(one)])
def test_an_example_that_serves_ends_by_ctrl_c(example: str, world: tuple[Path, dict[str, str]], monkeypatch) -> None:
    folder, names = world
    _at_home(monkeypatch, folder)
    monkeypatch.chdir(folder)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    words = [sys.executable, "-m", "pipelines.cli", *words_of(example, names)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    for patience in (20.0, 60.0):
        with subprocess.Popen(words, env=environment, **pipes) as process:
            too_long = threading.Timer(40.0 + patience, process.kill)
            too_long.start()
            if "--every" in example:  # a live table, which is written to a pipe when it ends
                threading.Event().wait(patience)
                first = ""
            else:
                first = process.stdout.readline()
            threading.Event().wait(1.0)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate()
            too_long.cancel()
        if first.strip() or out.strip():  # else it had not begun yet: this machine has other work
            break
    assert first.strip() or out.strip(), err
    assert process.returncode in {DONE, INTERRUPTED}, err
    assert "Traceback" not in err
    assert "defect" not in err
