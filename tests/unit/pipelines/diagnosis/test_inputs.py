"""What a judgement is made from: dwells left out, formulas; and the workbench, which judges as the command does."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from in_process import document_of

from inertial import effects, poses
from inertial.frames import force_from_angles
from pipelines.diagnosis.inputs import use_written_formulas
from pipelines.tables.leave_out import leave_out, named_dwells
from pipelines.workbench.services import requests
from pipelines.workbench.services.work import done_in_process
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import MissingPage
from schemas.errors import DataRejected, RecipeInvalid, WrongUse


@pytest.fixture
def settings(tmp_path: Path, rng: np.random.Generator) -> WorkbenchSettings:
    """A folder with the dwells of two units, one dwell of which is far off."""
    folder = tmp_path / "bench"
    folder.mkdir()
    force = force_from_angles(*np.radians(poses.plan("fibonacci24")).T)
    rows = []
    for unit in ("A1", "A2"):
        output = force + 3e-6 * rng.normal(size=force.shape)
        output[5] += 1e-3 * (unit == "A2")
        rows += [[unit, k, 10.0 * k, *output[k], *force[k], 100, 3e-5, 3e-5, 3e-5] for k in range(len(force))]
    axes = [f"{part}_{axis}" for part in ("out", "force") for axis in "xyz"]
    frame = pd.DataFrame(rows, columns=["unit", "dwell", "time_s", *axes, "n", "sd_x", "sd_y", "sd_z"])
    frame.to_csv(folder / "dwells.csv", index=False)
    return WorkbenchSettings(archive=str(tmp_path / "archive"), folder=folder, token="t")


def test_dwells_are_left_out_by_unit_and_number(settings: WorkbenchSettings) -> None:
    frame = pd.read_csv(settings.folder / "dwells.csv")
    assert named_dwells("A-1:3, A:1:4") == (("A-1", 3), ("A:1", 4))
    rest = leave_out(frame, named_dwells("A2:5, A1:0"))
    assert len(rest) == len(frame) - 2
    assert not ((rest["unit"] == "A2") & (rest["dwell"] == 5)).any()
    for wrong in ("A2", "A2:x", "A2:99", "B:1", ":1", "A2:-1"):
        with pytest.raises((WrongUse, DataRejected), match="--leave-out"):
            leave_out(frame, named_dwells(wrong))


def test_a_formula_of_a_line_is_an_effect_and_what_is_none_is_refused() -> None:
    with effects.additions_forgotten():
        assert use_written_formulas(["Damp = humidity_pct - 45; humidity_pct**2"], "diagnose") == ["damp"]
        assert len(effects.get("damp").names(0)) == 2
        for wrong in ("damp", "= x", "1a = hours", "a b = hours", "a = "):
            with pytest.raises(WrongUse):
                use_written_formulas([wrong], "diagnose")
        for wrong in ("a = __import__('os')", "a = hours(", "bias = hours"):
            with pytest.raises(RecipeInvalid):
                use_written_formulas([wrong], "diagnose")


def test_a_page_says_what_its_command_says(settings: WorkbenchSettings) -> None:
    source = str(settings.folder / "dwells.csv")
    page = requests.settled(
        settings, MissingPage(source=source, without=("A2:5",), formula=("late = hours",), added=("late",))
    )
    state, outcome = done_in_process("diagnose", requests.diagnosis(settings, page)[1], lambda *_: None)
    assert state == "done"
    with effects.additions_forgotten():
        told = document_of(*page.arguments())
    assert told["error"] == pytest.approx(outcome.document["error"])
    assert told["effects"] == outcome.document["effects"] == [*page.effects, "late"]
    assert told["classes"] == outcome.document["classes"]
    assert outcome.document["blocked_by"] == []
    assert outcome.table.residual.shape == (2, 3, 24)
    assert np.isnan(outcome.table.residual[1, :, 5]).all()  # the dwell that was left out
    assert outcome.before.shape == outcome.table.residual.shape
