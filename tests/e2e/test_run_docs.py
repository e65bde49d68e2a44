"""The guide to running a lot says what is so."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pipelines.cli import app
from pipelines.jobs.seating import Seating, read_seating
from schemas.station import load_station

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs" / "how-to" / "run-a-lot.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("command", ["run", "operator"])
def test_every_option_of_the_guide_is_one_of_the_command(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    shown = CliRunner().invoke(app, [command, "--help"]).output
    lines = [line for line in GUIDE.splitlines() if line.startswith(f"$ tumbleline {command} ")]
    assert lines
    for option in {flag for line in lines for flag in re.findall(r"(--[a-z-]+)", line)}:
        assert option in shown, option


def test_slot_maps_are_written_as_the_guide_says(tmp_path: Path) -> None:
    assert "a first line slot,serial, then 0,SN1" in GUIDE
    assert '[slots] with lines like 0 = "SN1"' in GUIDE
    for name, text in (("lot-17.csv", "slot,serial\n0,SN1\n"), ("lot-17.toml", '[slots]\n0 = "SN1"\n')):
        (tmp_path / name).write_text(text, encoding="utf-8")
        assert read_seating(str(tmp_path / name)) == Seating(("SN1",), (0,))


@pytest.mark.parametrize("slots", [16, 32])
def test_larger_fixtures_of_the_guide_are_there(slots: int) -> None:
    assert f"simulated-{slots}.toml" in GUIDE
    assert load_station(ROOT / "deploy" / "stations" / f"simulated-{slots}.toml").devices.slots.count == slots
