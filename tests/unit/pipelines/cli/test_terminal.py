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


def test_enter_is_yes_no_is_no_and_what_is_neither_is_asked_again(typed, capsys):
    for text, yes in (("\n", True), ("y\n", True), ("Yes \n", True), ("n\n", False), ("stop\n", False)):
        typed(text)
        assert agreed("Measure?") is yes
    capsys.readouterr()
    typed("maybe\nn\n")
    assert not agreed("Measure?")
    told = capsys.readouterr().err
    assert "'maybe' is neither yes nor no: y or Enter measures it, n leaves it" in " ".join(told.split())
    assert told.count("Measure? [Y/n]") == 2
    typed("")  # the terminal closed
    with pytest.raises(WrongUse, match="ended before an answer"):
        agreed("Measure?")
