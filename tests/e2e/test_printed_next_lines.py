"""The lines that `diagnose` prints under "Next", run as they are printed, for an effect that remembers the temperature."""

import json
import re
import shlex
from pathlib import Path

import pytest
from in_process import Given, given

from benchmarks.truth import Run, Spec, make_run


@pytest.fixture(scope="module")
def lagging() -> Run:
    spec = Spec(effects=("thermal_lag",), sizes=(4.0,), plan="six", soaks="ramps", units=3)
    return make_run(spec, 12)


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, no_next_measurement: None) -> Given:
    monkeypatch.chdir(tmp_path)
    return lambda *words: given(*words, columns=140)


def next_lines(out: str) -> list[list[str]]:
    """The commands under "Next", as words."""
    after = out.split("Next:", 1)[1]
    return [shlex.split(line) for line in re.findall(r"^ +tumbleline (.*)$", after, flags=re.MULTILINE)]


def one_row(out: str) -> str:
    return " ".join(out.split())


def written(run: Run, folder: Path, names: dict[str, str]) -> None:
    for table, name in names.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        getattr(run, table).to_parquet(path)


def test_the_printed_lines_carry_the_history_and_confirm_the_effect(command, lagging: Run, tmp_path: Path) -> None:
    names = {
        "dwells": "a/run7.parquet", "history": "b/temperatures.parquet", "fresh": "a/again.parquet",
        "fresh_history": "b/again-temperatures.parquet",
    }  # fmt: skip
    written(lagging, tmp_path, names)
    status, out, _ = command("diagnose", "a/run7.parquet", "--history", "b/temperatures.parquet")
    assert status == 1
    lines = next_lines(out)
    assert [words[0] for words in lines] == ["extend", "history"]
    assert lines[1][lines[1].index("--history") + 1] == "b/temperatures.parquet"
    assert "give it to history with --fresh and its temperatures with --fresh-history" in one_row(out)
    for words in lines:  # as they are printed
        status, out, err = command(*words)
        assert status == 0, err
    again = ("--fresh", "a/again.parquet", "--fresh-history", "b/again-temperatures.parquet")
    status, out, err = command(*lines[1], *again)
    assert status == 0, err
    assert re.search(r"(?<!not )confirmed:", one_row(out))
    assert "warning" not in out
    assert "remove it from the model" not in out


def test_files_beside_the_dwells_are_found_and_stand_in_the_printed_lines(
    command, lagging: Run, tmp_path: Path
) -> None:
    names = {
        "dwells": "dwells.parquet", "history": "history.parquet", "fresh": "fresh.parquet",
        "fresh_history": "fresh-history.parquet",
    }  # fmt: skip
    written(lagging, tmp_path, names)
    _, out, err = command("diagnose", "dwells.parquet")
    assert "history: history.parquet, found beside the dwells" in err
    lines = next_lines(out)
    assert lines[-1][lines[-1].index("--history") + 1] == "history.parquet"
    command(*lines[0])
    status, out, err = command(*lines[1], "--json")
    assert json.loads(out)["versions"][-1]["confirmed"] is True
    # the fresh run's own history stands beside it as well
    words = lines[-1][: lines[-1].index("--fresh")]
    status, out, err = command(*words, "--fresh", "fresh.parquet", "--json")
    row = json.loads(out)["versions"][-1]
    assert status == 0
    assert "fresh-history.parquet, found beside" in err
    assert row["confirmed"] is True
    assert row["warnings"] == []


def test_without_a_history_the_effect_is_warned_of_and_never_refuted(command, lagging: Run, tmp_path: Path) -> None:
    written(lagging, tmp_path, {"dwells": "a/run7.parquet", "history": "b/then.parquet", "fresh": "c/again.parquet"})
    model = "bias,scale,misalignment,bias_temperature,scale_temperature,thermal_lag"
    _, out, _ = command("compare", "a/run7.parquet", "--effects", model)
    assert "thermal_lag depends on the temperature between the dwells, and no history was given" in one_row(out)
    command("extend", "m.toml", "thermal_lag")
    words = (
        "history",
        "m.toml",
        "--dwells",
        "a/run7.parquet",
        "--history",
        "b/then.parquet",
        "--fresh",
        "c/again.parquet",
    )
    status, out, _ = command(*words)
    assert status == 0
    assert "no history of the fresh run was given" in one_row(out)
    assert "remove it from the model" not in out
    assert json.loads(command(*words, "--json")[1])["versions"][-1]["confirmed"] is None
