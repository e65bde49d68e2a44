"""The commands to give next have the files and options of the command before them."""

import shlex
from pathlib import Path
from typing import Any

import pytest
from each import each
from typed_commands import unknown_options

from pipelines.cli.certificate_issue import _print as print_issued
from pipelines.cli.history import removal
from pipelines.cli.next_commands import Given, JudgedData, extension, judged_data
from pipelines.cli.text.improve_text import next_lines, next_of_recording

OWN, FRESH = Path("my effects.py"), Path("fresh run.csv")
GIVEN = Given("kept runs", str(FRESH), "fresh temperatures.csv", "U1:3", (OWN,), ("damp=humidity_pct - 45",))
DATA = JudgedData("dwells.csv", "temperatures.csv", GIVEN.fresh, GIVEN.fresh_history, given=GIVEN)
KEPT = ("--output", "new.toml", "--who", "Q")
ARCHIVE, LEFT, EFFECTS = ("--archive", "kept runs"), ("--leave-out", "U1:3"), ("--effect-file", str(OWN))
AGAIN = ("--fresh", str(FRESH), "--fresh-temperatures", "fresh temperatures.csv")
TEMPERATURES = ("--temperatures", "temperatures.csv")


def has(words: list[str], options: tuple[str, ...]) -> bool:
    """Whether options with their values stand in a command."""
    return all(words[words.index(name) + 1] == value for name, value in zip(options[::2], options[1::2], strict=True))


def document(**changes: Any) -> dict[str, Any]:
    return {
        "refuted": [], "choices": [], "added": [], "fresh": None, "effects": ["bias", "damp"], "after": None,
        "diagnosis": {"recommended": ["third_order"]}, "file": None,
    } | changes  # fmt: skip


def told(made: dict[str, Any], model: Path | None) -> list[list[str]]:
    lines = next_lines(made, (model, Path("new.toml")), lambda: DATA, GIVEN, KEPT)
    assert [unknown_options(line) for line in lines] == [set()] * len(lines)
    return [shlex.split(line)[1:] for line in lines]


def test_an_improvement_alternatives_and_a_refuted_effect_have_all_that_the_command_before_was_given() -> None:
    (words,) = told(document(), Path("model.toml"))
    assert words[:2] == ["improve", "dwells.csv"]
    assert has(words, ("--model", "model.toml", *TEMPERATURES, *ARCHIVE, *EFFECTS, *LEFT, *AGAIN, *KEPT))
    (words,) = told(document(), None)
    assert has(words, ("--effects", "bias,damp"))
    added = document(added=["damp"], after={"recommended": ["third_order"]}, fresh="fresh run.csv", file="new.toml")
    (words,) = told(added, Path("model.toml"))
    assert has(words, ("--model", "new.toml"))  # the model that it has written
    choice = {"added": False, "effect": "damp", "not_separated_from": ["third_order"]}
    for words, name in zip(told(document(choices=[choice]), Path("m.toml")), ("damp", "third_order"), strict=True):
        assert has(words, ("--effect", name, "--model", "m.toml", *AGAIN, *KEPT))
    (words,) = told(document(refuted=["damp"]), None)
    assert words[:4] == ["extend", "new.toml", "--remove", "damp"]
    assert has(words, EFFECTS)
    assert shlex.split(removal(Path("m.toml"), (), "damp"))[-1] == "the fresh run is evidence against it"


def test_an_extension_has_the_effects_and_its_ladder_the_fresh_run() -> None:
    first, second, ladder = (
        shlex.split(line)[1:] for line in extension("m.toml", ["damp", "x"], ["bias"], DATA, new=True)
    )
    assert has(first, ("--effects", "bias", "--formula", GIVEN.formulas[0], "--dwells", "dwells.csv", *EFFECTS))
    assert has(second, EFFECTS)
    assert "--formula" not in second
    assert has(ladder, ("--dwells", "dwells.csv", *TEMPERATURES, *ARCHIVE, *EFFECTS, *LEFT, *AGAIN))
    assert [unknown_options(shlex.join(["tumbleline", *words])) for words in (first, ladder)] == [set(), set()]


FAULTY = {"leave_out": {"dwells": [{"unit": "U1", "dwell": 7}]}, "blocked_by": []}
INADEQUATE = {"leave_out": None, "blocked_by": [], "adequate": False}
CASES: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {  # by the command that follows
    "fit": ({"added": ["damp"], "file": "new.toml"}, ("--model", "new.toml", *LEFT, *EFFECTS)),
    "improve": ({"diagnosis": FAULTY}, ("--model", "m.toml", "--leave-out", "U1:3,U1:7", *EFFECTS, *AGAIN, *KEPT)),
    "diagnose": ({"diagnosis": INADEQUATE}, ("--model", "m.toml", *LEFT, *EFFECTS)),
}


@each(CASES)
def test_what_follows_a_recording_has_them_as_well(name: str) -> None:
    (changes, options), run = CASES[name], {"run": "R", "fit": "norm"}
    line = next_of_recording(document(next=[], **changes), run, GIVEN, ("--model", "m.toml"), KEPT)[0]
    assert unknown_options(line) == set()
    words = shlex.split(line)[1:]
    assert words[:2] == [name, "R"]
    assert has(words, (*options, *ARCHIVE))


def test_a_fresh_run_that_is_given_comes_before_one_that_is_beside_the_dwells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("dwells.csv", "fresh.csv", "history.csv"):
        Path(name).write_text("x\n", encoding="utf-8")
    assert judged_data("dwells.csv", "history.csv", Given()).fresh == "fresh.csv"
    found = judged_data("dwells.csv", "history.csv", GIVEN)
    assert (found.fresh, found.fresh_history) == (GIVEN.fresh, GIVEN.fresh_history)
    assert has(found.again, AGAIN)


def test_the_line_about_documents_names_the_archive(capsys: pytest.CaptureFixture[str]) -> None:
    entry = {"certificate": "A1/1", "serial": "A1", "grade": "consumer", "from": "", "until": "", "was_there": False}
    one = {**entry, "action": "certify", "ends": []}
    print_issued("kept runs", {"run": "R", "certified": [one], "left_out": {}})
    line = " ".join(capsys.readouterr().out.split())
    assert "tumbleline certificate write R --archive 'kept runs' --laboratory FILE" in line
