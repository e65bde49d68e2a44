"""Every export format that is found: it is named by the command and the guide, writes every unit, and says what it leaves out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from each import each
from typer.testing import CliRunner

from pipelines.cli import app
from pipelines.export import FORMATS, ExportSettings, UnitCalibration, export_files
from pipelines.export.polynomials import ORDER
from pipelines.export.teds import DataSheet
from pipelines.export.unit_noise import TERMS, UnitNoise
from schemas.errors import WrongUse

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "export.md"


def calibration(unit: str, left_out: tuple[str, ...] = ()) -> UnitCalibration:
    bias, response = np.zeros((ORDER, 3)), np.zeros((ORDER, 3, 3))
    bias[0], response[0] = (1e-4, -5e-5, 2e-5), 0.3 * np.eye(3)  # volts, which every format can hold
    noise = UnitNoise(
        dict.fromkeys(TERMS, np.array([16.0, 17.0, 18.0])), dict.fromkeys(TERMS, np.array([True, True, False])), 100.0
    )
    force = np.vstack([level * np.eye(3)[k] for k in range(3) for level in (-1.0, -0.5, 0.5, 1.0)])
    tables = (("force", force), ("out", force @ response[0].T + bias[0]))
    dwells = pd.DataFrame({f"{name}_{axis}": one[:, k] for name, one in tables for k, axis in enumerate("xyz")})
    made = UnitCalibration(unit, "pass", "industrial", "V", bias, response, (-10.0, 60.0), left_out, None, noise, 1.5)
    return replace(made, dwells=dwells)


SETTINGS = ExportSettings(
    nominal=0.3,
    device_ids={"SN1": 1310988, "SN2": 1310996},
    data_sheet=DataSheet(17, 4507, "B5", 4.6, "QA", "2026-05-01", 365),
)


def written(name: str, units: list[UnitCalibration]) -> dict[str, bytes]:
    return export_files(name, units, "run-1", SETTINGS)


@each(FORMATS)
def test_a_format_is_documented_names_every_unit_ends_its_last_line_and_drops_no_effect_silently(name: str) -> None:
    shown = " ".join(CliRunner().invoke(app, ["export", "--help"], env={"COLUMNS": "160"}).stdout.split())
    own = FORMATS[name].__doc__
    assert f"{name}: {own.partition(': ')[2].partition('.')[0].replace('``', '')[:60]}" in shown
    assert f"`{name}`" in GUIDE.read_text(encoding="utf-8")
    files = written(name, [calibration("SN1"), calibration("SN2")])
    for unit in ("SN1", "SN2"):
        assert any(unit.encode() in content for content in files.values())
    assert all(file.endswith(FORMATS[name].SUFFIX) for file in files)
    assert len(files) == 2 or not getattr(FORMATS[name], "ONE_UNIT", False)
    assert all(content.endswith(b"\n") for content in files.values() if b"\0" not in content)
    units = [calibration("SN1", ("third_order",))]
    if getattr(FORMATS[name], "COMPLETE", False):
        assert any(b"third_order" in content for content in written(name, units).values())
    else:
        with pytest.raises(WrongUse, match="third_order"):
            written(name, units)


@each(FORMATS)
def test_a_unit_that_failed_is_told_from_one_that_passed(name: str) -> None:
    failed = replace(calibration("SN1"), outcome="fail", grade="none", reasons="residual_rms_ug: 1.2 µg, limit 1 µg")
    files, passed = written(name, [failed]), written(name, [calibration("SN1")])
    marks = (
        b"FAILED: grade none, outside its limits: Rms residual of the fit: 1.2",
        b'"outcome": "fail"',
    )
    assert any(mark in content for mark in marks for content in files.values())
    assert not any(mark in content for mark in marks for content in passed.values())
