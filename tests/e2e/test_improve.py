"""`improve` on the files of the demonstration and on a lot whose effects cannot be separated; `extend --remove`."""

import io
import json
import re
import sys
from pathlib import Path

import pandas as pd
import pytest
from in_process import command

from benchmarks.truth import Spec, make_run
from deploy.release import unpack
from pipelines.cli import terminal
from pipelines.jobs.model_files import read_model, versions

PLAIN = "bias,scale,misalignment"
PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "improve-a-model.md"


pytestmark = pytest.mark.usefixtures("no_next_measurement")


def run(*words: object, typed: str = "") -> tuple[int, str, str]:
    """The command line in this process: status, standard output, standard error."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdin", io.StringIO(typed))
        done = command([*map(str, words)], 80)
    return done.returncode, done.stdout, done.stderr


@pytest.fixture(scope="module")
def game(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of the demonstration as the guide makes them."""
    folder = tmp_path_factory.mktemp("demo") / "game"
    shown = re.search(r"^\$ tumbleline (demo .*) --folder game$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert shown is not None
    assert run(*shown[1].split(), "--folder", folder)[0] == 0
    return folder


@pytest.fixture(scope="module")
def improved(game: Path) -> tuple[int, str, str]:
    """The guide's `improve`."""
    shown = re.search(r"^\$ tumbleline (improve .*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert shown is not None
    return run(*shown[1].replace("game/", f"{game}/").split())


@pytest.fixture(scope="module")
def alike(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A lot on six faces with a square term: on faces alone every even term looks alike."""
    folder = tmp_path_factory.mktemp("alike")
    spec = Spec(effects=("second_order",), sizes=(4.0,), plan="six", soaks="one", repeats=4, units=3)
    made = make_run(spec, 5)
    made.dwells.to_parquet(folder / "dwells.parquet")
    made.fresh.to_parquet(folder / "fresh.parquet")
    return folder


def test_the_guide_finds_adds_and_confirms_the_hidden_effect(improved, game: Path) -> None:
    status, out, _ = improved
    assert status == 0
    assert "ADEQUATE" in out
    assert "cross_coupling: confirmed:" in out
    model = read_model(game / "model.toml")
    assert model.model.effects == [*PLAIN.split(","), "cross_coupling"]
    assert "a diagnosis of dwells.parquet names it" in model.change[-1].why


def test_the_output_ends_with_the_ladder_of_the_guide(improved) -> None:
    block = re.findall(r"```text\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)[0]
    number = re.compile(r"\d+\.\d+")
    shown = improved[1].split("Error by version of the model")[1]
    words = [number.sub("#", text).split() for text in (shown, block)]
    assert words[0] == words[1]
    ladder = [[float(n) for n in number.findall(text.split("confirmed")[0])] for text in (shown, block)]
    assert ladder[0] == pytest.approx(ladder[1], rel=0.05)
    fitted, left_out, fresh, noise = (ladder[0][k : k + 2] for k in (0, 2, 4, 6))
    assert fresh[1] < 0.7 * fresh[0]
    assert noise[1] < fitted[1] * 1.2 < left_out[0]


def test_no_line_of_its_own_is_wider_than_80_columns_in_the_tables(improved) -> None:
    ladder = improved[1].split("Error by version of the model")[1].split("cross_coupling: confirmed")[0]
    assert max(map(len, ladder.splitlines())) <= 80


def test_a_refused_question_writes_nothing_and_names_the_next_command(alike: Path, tmp_path: Path) -> None:
    words = ("improve", alike / "dwells.parquet", "--effects", PLAIN, "--out", tmp_path / "m.toml")
    status, out, err = run(*words, typed="perhaps\nn\n")
    assert status == 1
    assert f"to {tmp_path / 'm.toml'}? [Y/n]" in " ".join(err.split())
    assert "'perhaps' is neither yes nor no: y or Enter adds it" in " ".join(err.split())
    assert "second_order is not added" in out
    assert "--effect second_order\n" in out.split("Next:")[1]
    assert "--effect fourth_order\n" in out.split("Next:")[1]
    assert list(tmp_path.iterdir()) == []


def test_an_end_of_input_is_no_answer(alike: Path, tmp_path: Path) -> None:
    words = ("improve", alike / "dwells.parquet", "--effects", PLAIN, "--out", tmp_path / "m.toml")
    status, _, err = run(*words)
    assert status == 2
    assert "give --yes to run without an operator" in err
    assert list(tmp_path.iterdir()) == []


def test_an_adequate_model_is_left_alone(alike: Path, tmp_path: Path) -> None:
    model = tmp_path / "m.toml"
    run("extend", model, "second_order", "--effects", PLAIN)
    before = model.read_text(encoding="utf-8")
    status, out, _ = run("improve", alike / "dwells.parquet", "--model", model, "--json")
    document = json.loads(out)
    assert status == 0
    assert document["adequate"] is True
    assert (document["added"], document["choices"], document["after"], document["next"]) == ([], [], None, [])
    assert len(document["ladder"]) == 1
    assert model.read_text(encoding="utf-8") == before


def test_a_class_of_several_is_not_decided_by_yes_but_by_an_answer_or_a_name(alike: Path, tmp_path: Path) -> None:
    target = tmp_path / "m.toml"
    words = ("improve", alike / "dwells.parquet", "--effects", PLAIN, "--out", target)
    status, out, _ = run(*words, "--yes", "--json")
    choice = json.loads(out)["choices"][0]
    assert status == 1
    assert choice["not_separated_from"]
    assert (choice["decided_by"], choice["added"], target.exists()) == ("undecided", False, False)

    status, out, err = run(*words, typed="\n")
    assert f"These data do not separate {choice['effect']} from" in " ".join(err.split())
    assert choice["effect"] in read_model(target).model.effects
    assert "these data do not separate it from" in " ".join(read_model(target).change[-1].why.split())
    assert "tumbleline history" in out


@pytest.mark.slow
def test_another_effect_of_a_class_is_added_when_it_is_named(alike: Path, tmp_path: Path) -> None:
    target = tmp_path / "m.toml"
    run("improve", alike / "dwells.parquet", "--effects", PLAIN, "--out", target, "--effect", "fourth_order")
    model = read_model(target)
    assert model.model.effects[-1] == "fourth_order"
    assert "second_order" in model.change[-1].why


def test_what_cannot_be_is_one_message_and_nothing_is_written(alike: Path, tmp_path: Path) -> None:
    data, target = alike / "dwells.parquet", tmp_path / "m.toml"
    words = ("improve", data, "--effects", PLAIN, "--out", target)
    status, _, err = run(*words, "--effect", "second_ordr")
    assert status == 2
    assert "did you mean second_order" in err
    target.write_text("a model of somebody else", encoding="utf-8")
    status, _, err = run(*words, "--yes")
    assert status == 2
    assert "is not the model that is judged" in err
    assert target.read_text(encoding="utf-8") == "a model of somebody else"


@pytest.mark.slow
def test_units_that_differ_in_the_fresh_run_leave_no_model_behind(alike: Path, tmp_path: Path) -> None:
    other = pd.read_parquet(alike / "fresh.parquet").assign(unit=lambda table: "other-" + table["unit"])
    other.to_parquet(tmp_path / "other.parquet")
    target = tmp_path / "m.toml"
    words = ("improve", alike / "dwells.parquet", "--effects", PLAIN, "--out", target, "--effect", "second_order")
    status, _, err = run(*words, "--fresh", tmp_path / "other.parquet")
    assert status == 2
    assert "every unit is needed in both" in err
    assert not target.exists()


def test_a_removed_effect_is_a_new_version_and_stays_in_the_history(tmp_path: Path) -> None:
    model = tmp_path / "m.toml"
    run("extend", model, "third_order", "--by", "Q")
    status, out, _ = run("extend", model, "--remove", "third_order", "--why", "refuted", "--by", "R", "--json")
    document = json.loads(out)
    assert status == 0
    assert (document["version"], document["added"], document["removed"]) == (3, None, "third_order")
    history = versions(read_model(model))
    assert [(v.added, v.removed) for v in history] == [((), ()), (("third_order",), ()), ((), ("third_order",))]
    assert (history[-1].change.by, history[-1].change.why) == ("R", "refuted")
    assert "− third_order" in run("history", model)[1]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--remove", "scale_temperatur", "--why", "x"], "did you mean scale_temperature"),
        (["--remove", "scale"], "add --why TEXT"),
        (["third_order", "--remove", "scale", "--why", "x"], "EFFECT and --remove are both given"),
        ([], "no effect is given"),
    ],
)
def test_a_removal_that_cannot_be_leaves_the_file_alone(tmp_path: Path, words: list[str], message: str) -> None:
    model = tmp_path / "m.toml"
    run("extend", model, "second_order")
    before = model.read_text(encoding="utf-8")
    status, _, err = run("extend", model, *words)
    assert status == 2
    assert message in err
    assert model.read_text(encoding="utf-8") == before


def test_the_last_effect_and_a_file_that_is_not_there_are_refused(tmp_path: Path) -> None:
    (tmp_path / "one.toml").write_text('[model]\nname = "m"\nversion = 1\neffects = ["bias"]\n', encoding="utf-8")
    assert "the only effect" in run("extend", tmp_path / "one.toml", "--remove", "bias", "--why", "x")[2]
    assert "needs a model file" in run("extend", tmp_path / "none.toml", "--remove", "bias", "--why", "x")[2]
    assert not (tmp_path / "none.toml").exists()


def test_other_questions_keep_their_words() -> None:
    assert "--no-prompts" in terminal.UNATTENDED


@pytest.mark.slow
def test_a_run_of_an_archive_is_improved_and_its_next_line_names_the_archive(tmp_path: Path) -> None:
    unpack(Path(__file__).resolve().parents[1] / "archives" / "v1.tar.xz", tmp_path / "kept")
    words = ("--archive", tmp_path / "kept", "--out", tmp_path / "m.toml", "--effects", f"{PLAIN},scale_temperature")
    status, out, _ = run("improve", "latest", *words, "--json", typed="\n" * 9)
    document = json.loads(out)
    assert status in {0, 1}
    assert document["added"]
    assert document["next"]
    assert all(f"--archive {tmp_path / 'kept'}" in line for line in document["next"])
    assert [change.run for change in read_model(tmp_path / "m.toml").change][1:] == ["latest"] * len(document["added"])
