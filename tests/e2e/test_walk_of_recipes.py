"""What ships, works at the first try: every recipe and station file of ``deploy`` by the commands that a page names for it."""

import re
import shlex
from itertools import product
from pathlib import Path

import pytest
from each import each
from in_process import command
from typed_commands import printed_commands

from schemas.errors import PART_FAILED, UNUSABLE
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
