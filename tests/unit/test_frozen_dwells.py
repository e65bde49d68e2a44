"""An axis that stands still in a dwell is named by its scatter; one pose has a model of its own."""

import lots
import numpy as np
import pandas as pd
import pytest

from pipelines.diagnosis.diagnose import default_model, diagnose
from pipelines.importers.mapping import build
from pipelines.importers.record import imported
from schemas.errors import DataRejected


@pytest.mark.parametrize("seed", range(25))
def test_one_frozen_dwell_of_known_pose_is_a_stuck_output(seed: int) -> None:
    rng = np.random.default_rng([4_401, seed])
    table = lots.lot(rng, units=1)
    row, axis = int(rng.integers(1, len(table))), str(rng.choice(list("xyz")))
    # 1000 equal samples: their mean differs from them, and from the last mean, in the last digits only
    table.loc[row, f"out_{axis}"] = float(np.mean(np.full(1000, table.loc[row - 1, f"out_{axis}"]) + 1e-17))
    table.loc[row, f"sd_{axis}"] = 1e-16
    diagnosis = diagnose(table)
    assert [(b["fault"], b["dwells"]) for b in diagnosis["blocked_by"]] == [
        ("stuck_output", [int(table.loc[row, "dwell"])])
    ]


def test_dwells_of_a_file_in_which_an_axis_stands_still_are_refused_or_left_out(rng: np.random.Generator) -> None:
    out = rng.normal(size=(12, 3))
    frame = pd.DataFrame(out / np.linalg.norm(out, axis=1, keepdims=True), columns=["ax", "ay", "az"])
    frame = frame.assign(sx=1e-3, sy=1e-3, sz=1e-3)
    frame.loc[7, "sy"] = 0.0
    columns = {"x": "ax", "y": "ay", "z": "az", "sd_x": "sx", "sd_y": "sy", "sd_z": "sz"}
    content = {"columns": columns, "units": {"output": "g"}, "unit": "A1", "rows": "dwells"}
    with pytest.raises(DataRejected, match=r"axis y is constant in dwell 'dwell 7' \(row 8\).*1 such dwells"):
        imported(frame, build(content, "t"), "f.csv")
    assert len(imported(frame, build({**content, "faulty": "leave-out"}, "t"), "f.csv").dwells) == 11
    assert len(imported(frame, build({**content, "faulty": "keep"}, "t"), "f.csv").dwells) == 12


def test_one_pose_is_judged_by_bias_and_its_temperature(rng: np.random.Generator) -> None:
    table = lots.lot(rng, units=1)
    assert default_model(table)[:3] == ["bias", "scale", "misalignment"]
    one = table.assign(outer_deg=0.0, inner_deg=0.0)
    assert default_model(one) == ["bias", "bias_temperature"]
    assert default_model(one.assign(unit_C=25.0)) == ["bias"]
