"""Every export format that is found: it is named by the command and the guide, writes every unit, and says what it leaves out."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from pipelines.cli import app
from pipelines.export import FORMATS, UnitCalibration, export_text
from pipelines.export.polynomials import ORDER
from schemas.errors import WrongUse

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "export.md"


def calibration(unit: str, left_out: tuple[str, ...] = ()) -> UnitCalibration:
    bias, response = np.zeros((ORDER, 3)), np.zeros((ORDER, 3, 3))
    bias[0], response[0] = (100.0, -50.0, 25.0), 256000.0 * np.eye(3)
    return UnitCalibration(unit, "pass", "industrial", "LSB", bias, response, (-10.0, 60.0), left_out)


@pytest.mark.parametrize("name", FORMATS)
def test_a_format_names_every_unit_and_ends_its_last_line(name: str) -> None:
    text = export_text(name, [calibration("SN1"), calibration("SN2")], "run-1", 256000.0)
    assert "SN1" in text
    assert "SN2" in text
    assert text.endswith("\n")


@pytest.mark.parametrize("name", FORMATS)
def test_an_effect_without_a_place_is_named_or_refused(name: str) -> None:
    units = [calibration("SN1", ("third_order",))]
    if getattr(FORMATS[name], "COMPLETE", False):
        assert "third_order" in export_text(name, units, "run-1", 256000.0)
    else:
        with pytest.raises(WrongUse, match="third_order"):
            export_text(name, units, "run-1", 256000.0)


@pytest.mark.parametrize("name", FORMATS)
def test_a_format_is_in_the_help_and_in_the_guide(name: str) -> None:
    assert name in CliRunner().invoke(app, ["export", "--help"]).stdout
    assert f"`{name}`" in GUIDE.read_text(encoding="utf-8")
