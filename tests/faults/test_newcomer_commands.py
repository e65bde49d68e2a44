"""Commands as somebody types them who knows none of their options yet."""

from importlib.metadata import version
from pathlib import Path

import pytest
from ledger_events import event
from typer.testing import CliRunner

from pipelines.archive import Archive
from pipelines.certificates import Ledger
from pipelines.cli import COMMANDS, app, main
from pipelines.diagnosis.sentences import verdict


def told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """Status, output and message of a command."""
    monkeypatch.setattr("sys.argv", ["tumbleline", *map(str, words)])
    with pytest.raises(SystemExit) as left:
        main()
    captured = capsys.readouterr()
    return int(left.value.code or 0), captured.out, captured.err


def test_the_version_is_told() -> None:
    result = CliRunner().invoke(app, ["--version"])
    assert (result.exit_code, result.stdout) == (0, f"tumbleline {version('tumbleline')}\n")


def test_help_puts_commands_under_what_they_are_for() -> None:
    text = CliRunner().invoke(app, ["--help"]).stdout
    assert all(part in text for part in {command.part for command in COMMANDS.values()})
    assert " Commands " not in text


@pytest.mark.parametrize(
    ("content", "words", "message"),
    [
        (None, [], "nosuch.csv: cannot be read (No such file or directory)"),
        ("t,ax,ay,az\n0,1,2,3\n", [], "no column of a.csv is mapped, x, y and z are needed at least (its columns: t, ax,"),
        ("t,ax,ay,az\n0,1,2,3\n", ["--map", "x=ax,y=ay,z=az"], "one of g, mg, m/s^2, V, mV, LSB is needed; add --units output=…"),
    ],
)  # fmt: skip
def test_an_import_without_a_mapping_tells_the_columns_that_there_are(
    monkeypatch, capsys, tmp_path: Path, content: str | None, words: list[str], message: str
) -> None:
    file = tmp_path / ("a.csv" if content else "nosuch.csv")
    if content:
        file.write_text(content, encoding="utf-8")
    status, out, err = told(monkeypatch, capsys, "import", file, *words, "--archive", tmp_path / "archive")
    assert (status, out) == (2, "")
    assert message in err


def test_a_serial_number_alone_shows_what_holds_today(monkeypatch, capsys, tmp_path: Path) -> None:
    Ledger(Archive(tmp_path)).add(event("A1", "2020-01-01", "2099-01-01"))
    Ledger(Archive(tmp_path)).add(event("B1", "2020-01-01", "2021-01-01"))
    status, out, _ = told(monkeypatch, capsys, "show", "A1", "--archive", tmp_path)
    assert (status, "certificate A1/1 is valid on" in out) == (0, True)
    status, out, _ = told(monkeypatch, capsys, "show", "B1", "--archive", tmp_path)
    assert (status, "no calibration is valid on" in out) == (1, True)


def test_a_slot_map_that_is_not_there_is_asked_for_in_both_its_forms(monkeypatch, capsys, tmp_path: Path) -> None:
    status, _, err = told(monkeypatch, capsys, "run", "--units", tmp_path / "lot.csv", "--archive", tmp_path)
    assert (status, "give the path of a slot map file in CSV or TOML" in err) == (2, True)


def test_optimise_may_be_spelled_with_a_z(monkeypatch, capsys) -> None:
    status, _, err = told(monkeypatch, capsys, "plan", "optimize", "nosuch.toml")
    assert (status, "'nosuch.toml'" in err) == (2, True)


@pytest.mark.parametrize(("rms", "told_so"), [(432.0, True), (441.0, True), (882.0, False)])
def test_an_error_below_the_noise_that_is_no_noise_is_said_to_be_small(rms, told_so) -> None:
    error = {"rms_ug": rms, "floor_ug": 441.0, "p_value": 4e-190}
    document = {"adequate": False, "error": error, "blocked_by": [], "units": ["U1"], "unexplained": None}
    said = verdict({**document, "classes": [{"effects": ["scale_temperature_quadratic"], "scope": "sensor"}]})
    assert said.startswith("NOT ADEQUATE")
    assert ("the misfit is smaller than the noise" in said) == told_so


def test_a_model_that_fits_beside_faulty_dwells_has_no_misfit() -> None:
    error = {"rms_ug": 24.6, "floor_ug": 28.9, "p_value": 0.74}
    group = {"effects": ["gain_step"], "scope": "data", "units": ["SN-2"], "dwells": [19]}
    document = {"adequate": False, "error": error, "blocked_by": [], "units": ["SN-1", "SN-2"], "unexplained": None}
    said = verdict({**document, "classes": [group]})
    assert "misfit" not in said
    assert "the run has faults of the data: gain_step (SN-2, dwell 19); without them the model is adequate:" in said
