"""Export: what firmware computes is what the project's own correction gives."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from capture_double import small_run

from inertial.correction import correct
from pipelines.archive import Run
from pipelines.export import FORMATS, export_text, unit_calibrations
from pipelines.tables.calibration import read_calibration
from pipelines.tables.dwells import lot_arrays
from schemas.errors import WrongUse

MAIN = """
#include <stdio.h>
#include "calibration.h"
int main(void)
{
    const double output[3] = {200000.0, -90000.0, 120000.0};
    double force[3];
    if (tumbleline_correct(&tumbleline_A1, output, 41.5, force)) return 1;
    printf("%.15g %.15g %.15g", force[0], force[1], force[2]);
    return 0;
}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return small_run(tmp_path_factory.mktemp("run"))


def test_the_polynomials_correct_as_the_model_does(run: Run) -> None:
    calibration = read_calibration(run.table("coefficients"), run.table("covariance"))
    lot = lot_arrays(run.table("dwells"))
    wanted = correct(calibration.effects, lot.state, lot.output, calibration.coefficients, calibration.nonlinear)
    for u, exported in enumerate(unit_calibrations(run, (), failed=True)):
        assert lot.state.temperature is not None
        temperatures = lot.state.temperature[u]
        corrected = [exported.correct(out[None], t)[0] for out, t in zip(lot.output[u], temperatures, strict=True)]
        np.testing.assert_allclose(corrected, wanted[u], atol=1e-11)


def test_the_c_header_computes_the_same(run: Run, tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler here")
    units = unit_calibrations(run, ("A1",), failed=True)
    (tmp_path / "calibration.h").write_text(export_text("c", units, run.id), encoding="utf-8")
    (tmp_path / "main.c").write_text(MAIN, encoding="utf-8")
    command = [compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "main.c", "-o", "main"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    told = subprocess.run([tmp_path / "main"], check=True, capture_output=True, text=True).stdout
    wanted = units[0].correct(np.array([[200000.0, -90000.0, 120000.0]]), 41.5)[0]
    np.testing.assert_allclose([float(word) for word in told.split()], wanted, rtol=1e-12)


def test_json_holds_every_digit(run: Run) -> None:
    units = unit_calibrations(run, (), failed=True)
    document = json.loads(export_text("json", units, run.id))
    assert document["units"][0]["bias"] == units[0].bias.tolist()
    assert document["run"] == run.id


@pytest.mark.parametrize("name", [name for name in FORMATS if not getattr(FORMATS[name], "COMPLETE", False)])
def test_refuses_a_format_with_no_place_for_an_effect(tmp_path_factory: pytest.TempPathFactory, name: str) -> None:
    folder = tmp_path_factory.mktemp("bent")
    run = small_run(folder, None, ('"scale_temperature"]', '"scale_temperature", "second_order"]'))
    with pytest.raises(WrongUse, match="effect second_order has no place"):
        export_text(name, unit_calibrations(run, (), failed=True), run.id)


def test_names_the_units_there_are(run: Run) -> None:
    with pytest.raises(WrongUse, match="no unit B7 in this run; there are A1, A2, A3"):
        unit_calibrations(run, ("B7",), failed=False)
