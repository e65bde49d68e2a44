"""`extend`, `history`, `improve` and `demo`: versions of a model, what each brings, and who decides between alternatives."""

import io
import re
import sys
from pathlib import Path

import pandas as pd
import printed_pages as pages
import pytest
from demonstrations import demonstration, demonstrations_measured_once
from each import each
from in_process import document_of, given, refused, text_of

from benchmarks.truth import Spec, make_run
from pipelines.demo.measure import DemoLot
from pipelines.demo.scenes import scene
from pipelines.jobs.model_files import read_model, versions

PLAIN = "bias,scale,misalignment"
PAGE = "docs/how-to/improve-a-model.md"

pytestmark = pytest.mark.usefixtures("no_next_measurement")


def typing(patch: pytest.MonkeyPatch, text: str) -> None:
    patch.setattr(sys, "stdin", io.StringIO(text))


def written(spec: Spec, folder: Path) -> Path:
    made = make_run(spec, 5)
    made.dwells.to_parquet(folder / "dwells.parquet")
    made.fresh.to_parquet(folder / "fresh.parquet")
    return folder


@pytest.fixture(scope="module")
def alike(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A lot on six faces with a square term: on faces alone every even term looks alike."""
    spec = Spec(effects=("second_order",), sizes=(4.0,), plan="six", soaks="one", repeats=4, units=3)
    return written(spec, tmp_path_factory.mktemp("alike"))


@pytest.fixture(scope="module")
def improved(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The demonstration of the guide and its `improve`: the folder, and what was printed."""
    folder = tmp_path_factory.mktemp("demo")
    demo, improve = (command.split()[1:] for command, _ in pages.examples(PAGE)[:2])
    with pytest.MonkeyPatch.context() as patch:
        demonstrations_measured_once(patch)
        patch.chdir(folder)
        for words in (demo, improve):
            status, out, err = given(*words, columns=80)
            assert status == 0, err
    return folder / "game", out


def test_compare_extend_and_history_see_the_error_fall(tmp_path: Path) -> None:
    spec = Spec(effects=("third_order",), sizes=(3.0,), plan="fibonacci24", soaks="one", repeats=3, units=4)
    folder, model = written(spec, tmp_path), tmp_path / "model.toml"
    lot = (folder / "dwells.parquet", "--fresh", folder / "fresh.parquet")
    made = text_of("extend", model, "third_order", "--effects", PLAIN, "--reason", "the maps", "--who", "Q", status=0)
    assert "created with version 1" in made
    assert document_of("extend", model, "bias_asymmetry")["version"] == 3
    after, before = (document_of("compare", *lot, *how) for how in (("--model", model), ("--effects", PLAIN)))
    assert after["fresh_rms_ug"] < 0.5 * before["fresh_rms_ug"]
    picture = tmp_path / "history.png"
    words = ("history", model, "--dwells", *lot, "--output", picture)
    rows = document_of(*words)["versions"]
    assert [row["confirmed"] for row in rows[:2]] == [None, True]
    assert rows[2]["confirmed"] is not True
    assert rows[1]["fall_ug"] > 3.0 * rows[1]["fall_u_ug"] > 0.0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert re.search("not decided|refuted", text_of(*words, status=0))


REFUSED = {
    "m.toml second_order": "in version 2 already",
    "m.toml forth_order": "did you mean fourth_order",
    "m.toml third_order --effects bias": "--effects is for a new file",
    "m.toml --remove scale_temperatur --reason x": "did you mean scale_temperature",
    "m.toml --remove scale": "add --reason TEXT",
    "m.toml third_order --remove scale --reason x": "EFFECT and --remove are both given",
    "m.toml": "no effect is given",
    "one.toml --remove bias --reason x": "the only effect",
    "none.toml --remove bias --reason x": "needs a model file",
}


@each(REFUSED)
def test_a_version_that_cannot_be_is_refused_and_leaves_the_file_alone(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("one.toml").write_text('[model]\nname = "m"\nversion = 1\neffects = ["bias"]\n', encoding="utf-8")
    text_of("extend", "m.toml", "second_order")
    before = {path: path.read_bytes() for path in Path().iterdir()}
    assert REFUSED[words] in refused("extend", *words.split())
    assert {path: path.read_bytes() for path in Path().iterdir()} == before


def test_another_file_takes_the_next_version_and_a_removed_effect_stays_in_the_history(home: Path) -> None:
    text_of("extend", "m.toml", "third_order", "--who", "Q")
    text = Path("m.toml").read_text(encoding="utf-8")
    text_of("extend", "m.toml", "second_order", "--output", "next.toml")
    assert Path("m.toml").read_text(encoding="utf-8") == text
    assert "second_order" in Path("next.toml").read_text(encoding="utf-8")
    document = document_of("extend", "m.toml", "--remove", "third_order", "--reason", "refuted", "--who", "R", status=0)
    assert (document["version"], document["added"], document["removed"]) == (3, None, "third_order")
    history = versions(read_model(Path("m.toml")))
    assert [(v.added, v.removed) for v in history] == [((), ()), (("third_order",), ()), ((), ("third_order",))]
    assert (history[-1].change.by, history[-1].change.why) == ("R", "refuted")
    assert "they need --dwells" in refused("history", "m.toml", "--output", "p.png")


@pytest.mark.slow  # with another scene: the demonstration below
def test_the_guide_finds_adds_and_confirms_the_hidden_effect(improved: tuple[Path, str]) -> None:
    folder, out = improved
    assert "ADEQUATE" in out
    model = read_model(folder / "model.toml")
    assert model.model.effects == [*PLAIN.split(","), "cross_coupling"]
    ladder = out.partition("Error by version of the model")[2]
    assert not pages.unlike(f"Error by version of the model{ladder}", f"…{pages.blocks(PAGE, 'text')[0]}…", 0.05)
    assert max(map(len, ladder.partition("cross_coupling: confirmed")[0].splitlines())) <= 80
    numbers = [float(n) for n in re.findall(r"\d+\.\d+", ladder.partition("confirmed")[0])]
    fitted, left_out, fresh, noise = (numbers[k : k + 2] for k in (0, 2, 4, 6))
    assert fresh[1] < 0.7 * fresh[0]
    assert noise[1] < fitted[1] * 1.2 < left_out[0]


def test_a_question_that_is_refused_or_not_answered_writes_nothing(
    alike: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "m.toml"
    words = ("improve", alike / "dwells.parquet", "--effects", PLAIN, "--output", target)
    typing(monkeypatch, "perhaps\nn\n")
    status, out, err = given(*words, columns=80)
    assert status == 1
    assert f"to {target}? [Y/n]" in " ".join(err.split())
    assert "'perhaps' is neither yes nor no: y or Enter adds it" in " ".join(err.split())
    assert "second_order is not added" in out
    for effect in ("second_order", "fourth_order"):
        assert f"--effect {effect}\n" in out.split("Next:")[1]
    typing(monkeypatch, "")
    status, _, err = given(*words)
    assert (status, "give --yes to run without an operator" in " ".join(err.split())) == (2, True)
    assert not target.exists()


def test_a_fresh_run_that_lacks_a_unit_is_refused_before_the_diagnosis(
    alike: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dwells = pd.read_parquet(alike / "dwells.parquet")
    lacking = dwells[dwells["unit"] != dwells["unit"].iloc[0]]
    lacking.to_parquet(tmp_path / "fresh.parquet")
    monkeypatch.setattr("pipelines.diagnosis.diagnose.examined", lambda *_: pytest.fail("a diagnosis was made"))
    words = ("improve", alike / "dwells.parquet", "--effects", PLAIN, "--output", tmp_path / "m.toml", "--yes")
    said = refused(*words, "--fresh", tmp_path / "fresh.parquet")
    assert f"{dwells['unit'].iloc[0]} not in both runs, every unit is needed in both" in said


@pytest.mark.slow
def test_a_class_of_several_is_not_decided_by_yes_but_by_an_answer_or_a_name(
    alike: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "m.toml"
    words = ("improve", alike / "dwells.parquet", "--effects", PLAIN, "--output", target)
    (choice, *_) = document_of(*words, "--yes", status=1)["choices"]
    assert choice["not_separated_from"]
    assert (choice["decided_by"], choice["added"], target.exists()) == ("undecided", False, False)
    typing(monkeypatch, "\n")
    _, _, err = given(*words)
    assert f"These data do not separate {choice['effect']} from" in " ".join(err.split())
    model = read_model(target)
    assert choice["effect"] in model.model.effects


def test_an_adequate_model_is_left_alone_and_what_cannot_be_writes_nothing(alike: Path, tmp_path: Path) -> None:
    data, model, target = alike / "dwells.parquet", tmp_path / "m.toml", tmp_path / "other.toml"
    text_of("extend", model, "second_order", "--effects", PLAIN)
    before = model.read_text(encoding="utf-8")
    document = document_of("improve", data, "--model", model, status=0)
    assert document["adequate"] is True
    assert (document["added"], document["choices"], document["after"], document["next"]) == ([], [], None, [])
    assert model.read_text(encoding="utf-8") == before
    words = ("improve", data, "--effects", PLAIN, "--output", target)
    status, _, err = given(*words, "--effect", "second_ordr")
    assert (status, "did you mean second_order" in err) == (2, True)
    target.write_text("a model of somebody else", encoding="utf-8")
    assert "is not the model that is judged" in refused(*words, "--yes")
    assert target.read_text(encoding="utf-8") == "a model of somebody else"


@pytest.fixture(scope="module")
def measured_game() -> DemoLot:
    """What the demonstration measures with a cubic transfer hidden."""
    return demonstration(scene("cubic_transfer", 7), 7)


def test_the_demonstration_finds_what_it_hid_and_a_player_may_add_something_else(
    measured_game: DemoLot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked = []
    monkeypatch.setattr("pipelines.demo.measure.measure", lambda *which: asked.append(which[:2]) or measured_game)
    words = ("demo", "cubic_transfer", "--seed", "7", "--folder")
    document = document_of(*words, tmp_path / "game", status=0)
    assert asked == [(scene("cubic_transfer", 7), 7)]
    assert document["hidden"]["effect"] == "third_order"
    assert (document["found"], document["added"]) == (True, ["third_order"])
    assert document["after"]["fresh_rms_ug"] < 0.8 * document["before"]["fresh_rms_ug"]
    tables = {f"{name}.parquet" for name in ("dwells", "history", "fresh", "fresh-history")}
    assert {path.name for path in (tmp_path / "game").iterdir()} == {*tables, "model.toml", "report.html"}
    typing(monkeypatch, "\n\nfifth_order\n\n\n\n\n")
    told = text_of(*words, tmp_path / "played", status=0)
    assert "Found." in told
    assert "fifth_order" in (tmp_path / "played" / "model.toml").read_text(encoding="utf-8")
    wrong = ("demo", "cubic_transfr", "--yes", "--folder", tmp_path / "none")
    assert "did you mean cubic_transfer" in refused(*wrong)
    assert not (tmp_path / "none").exists()
