"""What a person at the terminal answers to a question about the extra minutes."""

import io

import pytest

from pipelines.cli.terminal import agreed
from schemas.errors import WrongUse


@pytest.fixture
def typed(monkeypatch):
    def type_(text):
        monkeypatch.setattr("sys.stdin", io.StringIO(text))

    return type_


@pytest.mark.parametrize(
    ("text", "yes"), [("\n", True), ("y\n", True), ("Yes \n", True), ("n\n", False), ("stop\n", False)]
)
def test_enter_is_yes_and_no_is_no(typed, text, yes):
    typed(text)
    assert agreed("Measure?") is yes


def test_what_is_neither_is_asked_again_with_what_is_needed(typed, capsys):
    typed("maybe\nn\n")
    assert not agreed("Measure?")
    told = capsys.readouterr().err
    assert "'maybe' is neither yes nor no: y or Enter measures it, n leaves it" in " ".join(told.split())
    assert told.count("Measure? [Y/n]") == 2


def test_a_terminal_that_closes_is_no_answer(typed):
    typed("")
    with pytest.raises(WrongUse, match="ended before an answer"):
        agreed("Measure?")
