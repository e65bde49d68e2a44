"""Coefficients that correlate over the units of an archive, as rows of the document."""

import numpy as np
import pytest

from inertial.counts import number_of
from pipelines.cli.text.discovery_text import print_discoveries
from pipelines.discovery.coefficient_populations import correlations
from pipelines.tables.calibration import Calibration

MODEL = ("bias", "scale", "bias_temperature")


def lots(count: int, correlation: float) -> list[Calibration]:
    rng = np.random.default_rng(8)
    own = np.eye(3)
    own[0, 2] = own[2, 0] = correlation
    made: list[Calibration] = []
    for lot in range(count):
        values = rng.multivariate_normal(np.zeros(3), own, (8, 3)) + 0.1 * rng.standard_normal((8, 3, 3))
        units = tuple(f"{lot}-{unit}" for unit in range(8))
        made.append(Calibration(units, MODEL, values, np.tile(0.01 * np.eye(3), (8, 3, 1, 1)), {}, np.zeros(0)))
    return made


def test_a_pair_of_each_axis_is_told_by_its_names_and_in_a_sentence_on_the_screen(
    capsys: pytest.CaptureFixture[str],
) -> None:
    rows = correlations(lots(120, 0.5))
    assert sorted(row["figure"] for row in rows) == ["bias K0 x", "bias K0 y", "bias K0 z"]
    for row in rows:
        assert row["detail"]["with"] == f"bias_temperature kT {row['figure'][-1]}"
        assert row["detail"]["correlation"] == pytest.approx(0.5, abs=3.0 * row["detail"]["u"])
        assert row["detail"]["units"] == 960
    assert correlations(lots(120, 0.0)) == []
    (row, *_) = correlations(lots(60, 0.7))
    document = {
        "pooled": {"lots": 60, "units": 480, "left_out": [], "from": None, "until": None}, "device": "DEMO", "model": [],
        "error_control": {"alpha": 0.05, "log_e_needed": None}, "discoveries": [], "unexplained": [], "compared": [],
        "population": [row], "held": [], "warnings": [], "looking_back": False, "reach": [],
    }  # fmt: skip
    print_discoveries(document)  # type: ignore[arg-type]
    text = " ".join(capsys.readouterr().out.split())
    assert f"{number_of(480, 'unit calibration')}" in text
    assert f"{row['figure']} and bias_temperature kT" in text
    assert "of 480 units correlate by 0." in text
