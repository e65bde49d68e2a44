"""What commands load, take from their words, ask at the terminal, and say at the end of a demonstration."""

import errno
import io
import json
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from capture_double import small_run
from each import each
from in_process import command
from ledger_events import day
from typer.core import TyperCommand
from typer.testing import CliRunner

from pipelines import cli
from pipelines.certificates.ledger import Ledger
from pipelines.chain.certify import certify
from pipelines.cli import demo, take_texts_as_given
from pipelines.cli.terminal import agreed
from pipelines.cli.text.demo_text import print_ending
from pipelines.demo.scenes import scene
from schemas.errors import UNUSABLE, WrongUse

SHOWN = """
import json, sys
from pipelines.cli import main
sys.argv = ["tumbleline", *sys.argv[1:]]
try:
    main()
finally:
    print(json.dumps(sorted(sys.modules)), file=sys.stderr)
"""


def test_validity_of_a_serial_is_answered_without_numpy_and_pydantic(tmp_path: Path) -> None:
    run = small_run(tmp_path)
    run.seal()
    certify(Ledger(run.archive), run)
    words = ["show", "A1", "--at", day(), "--archive", str(run.archive.root)]
    for form in ([], ["--json"]):
        alone = subprocess.run([sys.executable, "-c", SHOWN, *words, *form], capture_output=True, text=True, check=True)
        loaded = set(json.loads(alone.stderr.splitlines()[-1]))
        assert "pyarrow.parquet" in loaded
        assert not {"numpy", "pandas", "scipy", "duckdb", "prefect", "pydantic"} & loaded
        assert alone.stdout == command([*words, *form]).stdout  # numpy is loaded here
    assert {row["unit"] for row in json.loads(alone.stdout)["calibration"]["coefficients"]} == {"A1"}


class _Direct(TyperCommand):
    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        take_texts_as_given(self)


def _called(words: list[str], *, direct: bool) -> tuple[dict[str, Any], int, str]:
    """What a command receives, its exit status and what it prints."""
    app, received = typer.Typer(pretty_exceptions_enable=False), dict[str, Any]()

    @app.command(cls=_Direct if direct else TyperCommand)
    def command(
        names: Annotated[list[str] | None, typer.Argument()] = None,
        text: Annotated[str, typer.Option("--text")] = "usual",
        short: Annotated[str, typer.Option("--short", parser=lambda given: given[:2])] = "",
        number: Annotated[int, typer.Option("--number", min=1)] = 3,
        file: Annotated[Path | None, typer.Option("--file")] = None,
        every: Annotated[list[str] | None, typer.Option("--every")] = None,
        *,
        flag: Annotated[bool, typer.Option("--flag")] = False,
    ) -> None:
        received.update(locals())

    result = CliRunner().invoke(app, words)
    received.pop("received", None)
    return received, result.exit_code, result.output


WORDS = [
    "one two",
    "--text '' --short letters",
    "--text 'naïve µg' --every a --every b",
    "--number 7 --file there.toml --flag",
    *("", "--number 0", "--number many", "--text \udcff", "--nothing", "--help"),
]


@each(WORDS, repr)
def test_a_command_receives_what_typer_would_give(line: str) -> None:
    words = shlex.split(line)
    given = _called(words, direct=True)
    assert given == _called(words, direct=False)
    assert given[0] or given[1] or "--help" in words


def test_enter_is_yes_no_is_no_and_what_is_neither_is_asked_again(monkeypatch, capsys):
    for text, yes in (("\n", True), ("y\n", True), ("Yes \n", True), ("stop\n", False), ("maybe\nn\n", False)):
        monkeypatch.setattr("sys.stdin", io.StringIO(text))
        assert agreed("Measure?") is yes
    told = capsys.readouterr().err
    assert "'maybe' is neither yes nor no: y or Enter measures it, n leaves it" in " ".join(told.split())
    assert told.count("Measure? [Y/n]") == 6
    monkeypatch.setattr("sys.stdin", io.StringIO(""))  # the terminal closed
    with pytest.raises(WrongUse, match="ended before an answer"):
        agreed("Measure?")


NONE = {"rms_ug": 9.0, "heldout_rms_ug": 9.5, "fresh_rms_ug": 9.9, "floor_ug": 4.0}
CLASS = ["aging_log", "warm_up", "thermal_lag"]


def ending(capsys: pytest.CaptureFixture[str], **changes: Any) -> str:
    hidden = scene("warm_up", 0)
    document = {
        "hidden": {"kind": hidden.kind, "effect": hidden.effect, "physics": hidden.truth}, "folder": "game",
        "classes": [CLASS], "unseen": [], "added": ["thermal_lag"], "found": True, "told_apart": False,
        "not_told_apart": [CLASS], "next_measurements": [], "before": NONE, "after": NONE, **changes,
    }  # fmt: skip
    print_ending(document)
    return " ".join(capsys.readouterr().out.split())


def test_an_effect_that_stands_alone_is_found_and_one_of_a_class_is_separated_by_a_measurement_or_by_none(
    capsys: pytest.CaptureFixture[str],
) -> None:
    row = {
        "outer_deg": 0.0, "inner_deg": 90.0, "chamber_C": 25.0, "why": "aging_log | warm_up", "minutes": 12.0,
        "separation_before": 0.4, "separation_after": 60.0, "separation_if": {"aging_log": 60.0, "warm_up": 75.0},
        "not_parted": ["thermal_lag"],
    }  # fmt: skip
    said = ending(capsys, next_measurements=[row])
    assert "Found in a class, not separated" in said
    assert "thermal_lag, is one of a class; these data fit equally well with aging_log, warm_up." in said
    assert "expected 60 if aging_log is true, 75 if warm_up is true; not separated from the first: thermal_lag" in said
    assert "Found." not in said
    assert "No measurement that the station can take is certain to separate them." in ending(capsys)
    words = {"why": "aging_log | warm_up: no steps of this station are certain to separate them; needed: a power cycle"}
    said = ending(capsys, next_measurements=[words | {"measurable": False}])
    assert "needed: a power cycle" in said
    said = ending(capsys, classes=[["warm_up"]], told_apart=True, not_told_apart=[])
    assert "The diagnosis named warm_up. Found." in said


def test_a_full_disk_is_no_defect_of_the_program(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(cli, "app", full)
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == UNUSABLE
    assert "make room" in capsys.readouterr().err


def test_a_demonstration_keeps_the_model_of_the_one_before(tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text("mine", "utf-8")
    aside = demo._put_aside(tmp_path / "model.toml")
    assert aside == tmp_path / "model-1.toml"
    assert aside.read_text("utf-8") == "mine"
    assert demo._put_aside(tmp_path / "model.toml") is None


@pytest.mark.slow
def test_a_closed_stream_is_no_defect_and_no_verdict() -> None:
    for closed, words, status in (
        (">&-", "plan keys names --json", 0),
        ("<&- >&- 2>&-", "list --archive none", UNUSABLE),
    ):
        told = subprocess.run(
            ["sh", "-c", f'exec "$0" -m pipelines {words} {closed}', sys.executable], capture_output=True, check=False
        )
        assert (told.returncode, told.stderr) == (status, b"")
