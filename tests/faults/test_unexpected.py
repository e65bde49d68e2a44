"""What nobody foresaw is one line, a report and a status of its own; what a person can put right is not among it."""

from pathlib import Path

import pytest

from pipelines.cli import main

MAPPED = ("--map", "time=t,x=ax,y=ay,z=az", "--units", "output=g", "--unit", "A1")


def told(monkeypatch, capsys, *words: object) -> tuple[int, str, str]:
    monkeypatch.setattr("sys.argv", ["tumbleline", *map(str, words)])
    with pytest.raises(SystemExit) as left:
        main()
    captured = capsys.readouterr()
    return int(left.value.code or 0), captured.out, captured.err


@pytest.fixture
def broken(monkeypatch, tmp_path: Path) -> Path:
    """A product with a defect; the folder of its states."""

    def defect(*_: object) -> None:
        raise KeyError("x")

    monkeypatch.setenv("TUMBLELINE_STATE", str(tmp_path / "state"))
    monkeypatch.setattr("pipelines.importers.files.read_content", defect)
    return tmp_path / "state"


def test_an_unexpected_exception_is_one_line_and_a_report_with_status_70(monkeypatch, capsys, broken: Path) -> None:
    status, out, message = told(monkeypatch, capsys, "import", "s3://me:secret@host/a.csv", *MAPPED)
    assert (status, out, message.count("\n")) == (70, "", 1)
    report = next(broken.glob("unexpected-*.txt"))
    assert message.startswith("tumbleline: unexpected KeyError in ")
    assert str(report) in message
    text = report.read_text()
    assert "Traceback (most recent call last)" in text
    assert "secret" not in text
    assert report.stat().st_mode & 0o077 == 0


def test_a_variable_shows_the_traceback_on_the_screen(monkeypatch, capsys, broken: Path) -> None:
    monkeypatch.setenv("TUMBLELINE_DEBUG", "1")
    status, _, message = told(monkeypatch, capsys, "import", "a.csv", *MAPPED)
    assert status == 70
    assert "Traceback (most recent call last)" in message


def test_a_folder_of_states_that_takes_nothing_still_leaves_one_line(monkeypatch, capsys, broken: Path) -> None:
    broken.write_text("a file where the folder should be")
    status, _, message = told(monkeypatch, capsys, "import", "a.csv", *MAPPED)
    assert (status, message.count("\n")) == (70, 1)


def test_reports_do_not_pile_up(monkeypatch, capsys, broken: Path) -> None:
    broken.mkdir()
    for day in range(30):
        (broken / f"unexpected-202501{day:02d}T000000-1.txt").write_text("")
    told(monkeypatch, capsys, "import", "a.csv", *MAPPED)
    assert len(list(broken.glob("unexpected-*.txt"))) == 20


@pytest.mark.parametrize(
    "words",
    [("show", "x" * 5000), ("plan", "x" * 5000), ("diagnose", "x" * 5000 + ".csv"), ("import", "x" * 5000, *MAPPED)],
)
def test_a_name_that_no_file_can_have_is_told(monkeypatch, capsys, tmp_path: Path, words) -> None:
    archive = () if words[0] == "plan" else ("--archive", tmp_path)
    status, out, message = told(monkeypatch, capsys, *words, *archive)
    assert (status, out) == (2, "")
    assert len(message) < 400
