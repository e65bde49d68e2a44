"""The command line on the simulated station: what it prints, where, with which status, how fast; lists, threads, the tab key."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from capture_double import BRIEF, recipe_file
from each import each
from in_process import document_of, given, text_of, typed_document
from root_process import ROOT

from deploy.release import unpack
from pipelines.archive import Archive
from pipelines.cli import COMMANDS, THREADS, _OnDemand
from pipelines.cli.candidates import SOURCES, candidates_of

KEPT = ROOT / "tests" / "archives" / "v1.tar.xz"


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An archive with one run of a small lot, made by the command itself without the orchestrator."""
    folder = tmp_path_factory.mktemp("line")
    status, out, err = given("run", recipe_file(folder, *BRIEF), "--direct", "--json", "--archive", folder / "archive")
    assert status in (0, 1), err
    (folder / "run.json").write_text(out, encoding="utf-8")
    (folder / "run.err").write_text(err, encoding="utf-8")
    return folder / "archive"


def test_run_prints_one_document_and_tells_its_stages_elsewhere(archive: Path) -> None:
    document = typed_document("run", (archive.parent / "run.json").read_text(encoding="utf-8"))
    assert [unit["unit"] for unit in document["units"]] == ["A1", "A2", "A3"]
    assert document["passed"] + document["failed"] + document["refused"] == 3
    assert Path(document["report"]).is_file()
    figure = document["units"][0]["figures"]["verification_norm_ug"]
    assert (figure["limit"], figure["unit_text"], "ILAC-G8" in figure["rule"]) == (1000.0, "µg", True)
    told = (archive.parent / "run.err").read_text(encoding="utf-8")
    assert [line.split()[0] for line in told.splitlines() if line][:3] == ["capture", "validate", "reduce"]


@pytest.fixture
def listed(tmp_path: Path) -> Archive:
    """A kept archive of an older version, with one run more that computes its only run again, and one that has just begun."""
    unpack(KEPT, tmp_path)
    store = Archive(next(path.parent for path in tmp_path.rglob("runs") if path.is_dir()))
    old = store.run("latest")
    measured = {key: old.about[key] for key in ("recipe", "lot", "station")}
    again = store.open_run("again", {**measured, "rerun_of": old.id}, 1)
    again.adopt(old, ("grades",))
    again.save_report("key", "<html></html>", {})
    store.open_run("begun", {"lot": {"device": "ADXL355", "units": [{"serial": "S1", "slot": 0}]}}, 2)
    return store


def test_the_list_has_result_station_and_origin_of_every_run(listed: Archive) -> None:
    words = ("list", "--archive", listed.root)
    rows = document_of(*words, status=0)["runs"]
    found = [(row["passed"], row["graded"], bool(row["rerun_of"]), row["station"]) for row in rows]
    assert found == [(2, 2, False, "simulated"), (2, 2, True, "simulated"), (None, None, False, "")]
    assert f"{rows[1]['id']} is a re-run of {rows[1]['rerun_of']}" in text_of(*words)


ASKED = """
import json, sys
{change}
from pipelines.cli import main
sys.argv = ["tumbleline", *{words}]
try:
    main()
except SystemExit:
    pass
loaded = [*sys.modules]
import threadpoolctl
import numpy, scipy.linalg
pools = [one["num_threads"] for one in threadpoolctl.threadpool_info() if one["user_api"] == "blas"]
sys.stderr.write("\\n" + json.dumps({{"loaded": loaded, "pools": pools}}) + "\\n")
"""
HEAVY = {"numpy", "pandas", "scipy", "prefect", "pymodbus", "matplotlib", "pydantic", "pyarrow"}
LATER = {"scipy.stats", "scipy.io", "matplotlib", "prefect", "pymodbus", "duckdb", "jinja2"}
FIRST_LINE = """
import pipelines.cli.diagnose as module
class Stop:
    def status(self, text):
        sys.exit()
module.error_console = Stop
"""


def process_of(*words: str, change: str = "", **variables: str) -> tuple[set[str], set[int]]:
    """The modules that a command has loaded in a process of its own, and the numbers of BLAS threads after it."""
    environment = {key: value for key, value in os.environ.items() if key not in THREADS} | variables
    code = ASKED.format(words=list(words), change=change)
    pipes = {"env": environment, "capture_output": True, "text": True}
    done = subprocess.run([sys.executable, "-c", code], check=True, timeout=300, **pipes)
    found = json.loads(done.stderr.splitlines()[-1])
    return set(found["loaded"]), set(found["pools"])


def test_help_loads_nothing_heavy_and_a_command_what_it_needs_on_one_thread(archive: Path) -> None:
    assert not process_of("--help")[0] & HEAVY
    # diagnose shows its first line before it loads what only the diagnosis needs
    loaded, pools = process_of("diagnose", "latest", "--archive", str(archive), change=FIRST_LINE)
    assert loaded >= {"numpy", "pandas"}
    assert not loaded & LATER
    assert pools == {1}


@pytest.mark.slow
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="BLAS takes no second thread on one processor")
def test_a_number_of_threads_that_the_user_has_set_is_kept() -> None:
    assert process_of("--version", OMP_NUM_THREADS="2")[1] == {2}
    # without the setting there are several: the test could fail
    assert max(process_of("--version", change="import pipelines.cli; pipelines.cli._one_thread = lambda: None")[1]) > 1


TAB = """
source "$1"
COMP_WORDS=("${@:2}")
COMP_CWORD=$(( ${#COMP_WORDS[@]} - 1 ))
_tumbleline_completion tumbleline
printf '%s\\n' "${COMPREPLY[@]}"
"""
OFFERED = {
    "dia": {"diagnose"},
    "run m": {"my"},
    "show la": {"latest"},
    "show A": {"A1", "A2"},
    "extend model.toml third": {"third_order"},
    "diagnose latest --effects bias,sca": {"bias,scale", "bias,scale_temperature"},
    "plan opt": {"optimise"},
    "run --fau": {"--fault"},
    "correct flight.csv la": {"latest"},
    "import a.csv --set blo": {"block_s="},
    "plan optimise production --wanted third": {"third_order"},
    "nonsense ": set(),
}


@pytest.fixture(scope="module")
def completing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home in which the completion is installed, and a working folder with an archive and a recipe."""
    if shutil.which("bash") is None:
        pytest.skip("no bash")
    folder = tmp_path_factory.mktemp("home")
    unpack(KEPT, folder / "archive")
    (folder / "recipes").mkdir()
    (folder / "recipes" / "my.toml").write_text("", encoding="utf-8")
    done = bash("tumbleline --install-completion; true", folder)
    assert "bash completion installed" in done.stdout, done.stderr
    assert ".bash_completions/tumbleline.sh" in (folder / ".bashrc").read_text(encoding="utf-8")
    return folder


def bash(script: str, home: Path, *words: str) -> subprocess.CompletedProcess[str]:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {"HOME": str(home), "PATH": path, "XDG_CONFIG_HOME": str(home / "config"), "LANG": "C.UTF-8"}
    command = ["bash", "--norc", "-c", script, "bash", *words]
    pipes = {"cwd": home, "env": environment, "capture_output": True, "text": True}
    return subprocess.run(command, check=False, timeout=300, **pipes)


@pytest.mark.slow
@each(["run m", "plan optimise production --wanted third"])
def test_the_tab_key_offers_in_a_real_bash(words: str, completing: Path) -> None:
    script = str(completing / ".bash_completions" / "tumbleline.sh")
    done = bash(TAB, completing, script, "tumbleline", *words.split(" "))
    assert done.stderr == ""
    assert OFFERED[words] <= set(done.stdout.split())


@each(OFFERED)
def test_what_the_tab_key_offers(words: str, completing: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(completing)
    # else the program would be named after pytest, which runs as a package
    monkeypatch.setattr(sys.modules["__main__"], "__package__", None)
    typed = ["tumbleline", *words.split(" ")]
    asked = {"_TUMBLELINE_COMPLETE": "complete_bash", "COMP_WORDS": " ".join(typed), "COMP_CWORD": str(len(typed) - 1)}
    for name, value in asked.items():
        monkeypatch.setenv(name, value)
    offered = given()[1].split()
    assert OFFERED[words] <= {*offered}
    assert OFFERED[words] or not offered  # nothing is offered where a word is wrong


def leaves(command: object) -> list[object]:
    below = getattr(command, "commands", {})
    return [leaf for one in below.values() for leaf in leaves(one)] if below else [command]


def test_every_parameter_that_takes_a_name_has_candidates_and_every_source_a_parameter() -> None:
    parameters = [
        (name, parameter, str(getattr(parameter, "metavar", "") or ""))
        for name in COMMANDS
        for leaf in leaves(_OnDemand(name)._load())
        for parameter in leaf.params
    ]
    names = ("RUN", "RECIPE", "PROFILE", "PRESET", "EFFECT", "SERIAL", "SELECTION")
    assert [
        (name, parameter.name, metavar)
        for name, parameter, metavar in parameters
        if any(word in metavar.replace("FLOW-RUN", "") for word in names) and candidates_of(parameter) is None
    ] == []
    used = {(parameter.name, part) for _, parameter, metavar in parameters for _, part in SOURCES if part in metavar}
    assert [key for key in SOURCES if key not in used] == []
