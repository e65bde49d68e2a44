"""The package for Python, as a scientist uses it, and its notebooks: truths from physics, answers as of the commands."""

import inspect
import json
import subprocess
import sys
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from demonstrations import demonstrations_measured_once
from in_process import document_of

import tumbleline as tl
from docs import notebooks

ROOT = Path(__file__).resolve().parents[2]
LIGHT = (
    "import sys, time; t = time.perf_counter(); import tumbleline; t = time.perf_counter() - t; print(t, *sys.modules)"
)


@pytest.fixture(scope="module")
def turned() -> pd.DataFrame:
    """A record turned by hand to 24 positions, 3 s each; a spring that hardens: the output follows x with f = x + 0.02·x³."""
    rng = np.random.default_rng(20261126)
    force = rng.normal(size=(24, 3))
    force /= np.linalg.norm(force, axis=1)[:, None]
    x = force.copy()
    for _ in range(60):
        x = force - 0.02 * x**3
    turn = np.array([[1.01, 0.002, -0.003], [0.001, 0.99, 0.004], [0.002, 0.0, 1.02]])
    output = np.repeat(x @ turn.T + [0.02, -0.01, 0.03], 300, axis=0) + 1e-3 * rng.normal(size=(7200, 3))
    return pd.DataFrame(output, columns=["ax", "ay", "az"]).assign(
        t=np.arange(7200) / 100.0, turn=np.repeat(np.arange(24), 300)
    )


@pytest.fixture(scope="module")
def lot() -> tl.Example:
    """What the demonstration measures with a cubic transfer hidden."""
    with pytest.MonkeyPatch.context() as patch:
        demonstrations_measured_once(patch)
        return tl.example("cubic_transfer", seed=7)


@pytest.mark.usefixtures("no_next_measurement")
def test_a_record_of_ones_own_from_reading_to_corrected_samples(turned: pd.DataFrame, tmp_path: Path) -> None:
    run = tl.read(turned.drop(columns="turn"), units={"output": "g"})
    assert any("ax, ay, az" in line for line in run.told)
    assert len(run.dwells) == 24
    assert tl.read(turned[["t", "ax", "ay", "az"]].set_index("t"), units={"output": "g"}).dwells.equals(run.dwells)
    spans = turned[["ax", "ay", "az"]].set_index(pd.to_timedelta(turned["t"], unit="s"))
    columns = ["time_s", "out_x", "sd_z"]
    assert np.allclose(tl.read(spans, units={"output": "g"}).dwells[columns], run.dwells[columns], rtol=1e-9)
    untimed = tl.read(turned[["ax", "ay", "az"]], units={"output": "g"}, rate_hz=100.0)
    assert not any("assumed" in line for line in untimed.told)  # what was stated is not assumed
    for name, part in (("1.csv", turned[:3600]), ("2.csv", turned[3600:])):
        part.drop(columns="turn").to_csv(tmp_path / name, index=False)
    parts = [tmp_path / "1.csv", tmp_path / "2.csv"]  # the second one begins with a position
    assert len(tl.read(parts, units={"output": "g"}).dwells) == 24
    fit = tl.fit(run)
    diagnosis = tl.diagnose(run, fit)
    assert diagnosis.adequate is False
    assert diagnosis.missing["effect"].tolist() == ["third_order"]
    better = tl.improve(run)
    assert better.added == ["third_order"]
    assert better.adequate is True
    ladder = better.ladder
    assert ladder["fitted_ug"].iloc[-1] < 0.1 * ladder["fitted_ug"].iloc[0]
    rows = better.calibration.coefficients.query("effect == 'bias'")
    assert np.all(np.abs(rows["value"] - [0.02, -0.01, 0.03]) < 1.5 * rows["U"])
    sizes = []
    samples = turned[["ax", "ay", "az"]].set_axis(list("xyz"), axis=1)
    for model in (fit, better):
        corrected = model.correct(samples, temperature=25.0, rate_hz=100.0)
        force = corrected[["force_x_g", "force_y_g", "force_z_g"]].groupby(turned["turn"]).mean()
        sizes.append(np.sqrt(np.mean((np.linalg.norm(force, axis=1) - 1.0) ** 2)))
    assert sizes[1] < 2e-4  # noise of a mean: 1 mg/√300 = 58 µg an axis
    assert sizes[0] > 1e-3


@pytest.mark.slow
def test_the_answers_are_those_of_the_commands(lot: tl.Example, tmp_path: Path) -> None:
    lot.run.dwells.to_parquet(tmp_path / "dwells.parquet")
    lot.run.history.to_parquet(tmp_path / "history.parquet")
    document = document_of("diagnose", str(tmp_path / "dwells.parquet"), "--effects", ",".join(lot.model), status=1)
    ours = tl.diagnose(lot.run, lot.model)
    for key in ("adequate", "classes", "recommended", "error"):
        assert json.loads(json.dumps(ours.document[key])) == document[key]
    assert lot.reveal().startswith("third_order")
    better = tl.improve(lot.run, lot.model, fresh=lot.fresh)
    assert better.added == ["third_order"]
    assert better.ladder["confirmed"].iloc[-1] is True or bool(better.ladder["confirmed"].iloc[-1])


@pytest.mark.slow
def test_objects_draw_themselves_and_export_and_an_archive_is_tables(turned: pd.DataFrame, tmp_path: Path) -> None:
    kept = tmp_path / "archive"
    run = tl.read(turned.drop(columns="turn"), units={"output": "g"}, serial="SN7", archive=kept)
    fit = tl.fit(run)
    diagnosis = tl.diagnose(run, fit)
    for one in (run, fit, diagnosis):
        assert "SN7" in one._repr_html_() or "NOT ADEQUATE" in one._repr_html_()
        assert one.plot()._repr_svg_().startswith("<svg")
    assert fit.plot().save(tmp_path / "residuals.svg").read_text().startswith("<svg")
    assert "NOT ADEQUATE" in diagnosis.report(tmp_path / "report.html").read_text(encoding="utf-8")
    assert json.loads(fit.export("json"))["units"][0]["unit"] == "SN7"
    with pytest.raises(tl.WrongUse, match="no format is called 'jsom'"):
        fit.export("jsom")
    view = tl.archive(kept)
    assert fit.run.id in view.runs["id"].tolist()
    rows = view.coefficients("SN7")
    with pytest.raises(tl.WrongUse, match="no run has any of unit SN8; did you mean SN7"):
        view.coefficients("SN8")
    assert set(rows["effect"]) == {"bias", "scale", "misalignment"}
    assert view.query("SELECT count(*) AS n FROM coefficients")["n"].iloc[0] == len(rows)
    assert view.calibration(fit.run.id).rms_ug == fit.rms_ug
    with pytest.raises(tl.WrongUse, match="no calibration of unit SN7 is valid on 2026-05-01"):
        view.coefficients("SN7", at=date(2026, 5, 1))
    with pytest.raises(tl.TumblelineError, match="holds no archive"):
        tl.archive(tmp_path / "nothing")


@pytest.mark.usefixtures("no_next_measurement")
def test_what_is_open_is_refused_with_what_to_state(lot: tl.Example, tmp_path: Path) -> None:
    table, dwells = pd.DataFrame(np.random.default_rng(1).normal(size=(50, 2)), columns=["p", "q"]), lot.run.dwells
    for what, how, message in (
        (table, {}, "columns="),
        (tmp_path / "absent.csv", {}, r"absent\.csv"),
        *(
            (one, {}, rf"read: found {type(one).__name__}, .* DataFrame")
            for one in (table["p"], {"p": [1.0]}, None, [])
        ),
        (table, {"units": "g"}, r"write units=\{'output': 'g'\}"),
        (table, {"columns": ["p", "q"]}, r"are needed: columns=\{'x'"),
        (pd.concat([dwells, dwells[["out_x"]]], axis=1), {}, "column 'out_x' is there twice"),
        (dwells.iloc[:0], {}, "without rows"),
        (table, {"history": lot.run.history}, "history: not used for a recording that is imported"),
        (dwells, {"serial": "SN1", "rate_hz": 100.0}, "serial, rate_hz: not used for a table of dwells"),
        ("latest", {"serial": "SN1", "units": {"output": "g"}}, "serial, units: not used for a run"),
    ):
        with pytest.raises((tl.WrongUse, tl.DataRejected), match=message):
            tl.read(what, **how)
    with pytest.raises(tl.DataRejected, match="every unit is needed in both"):
        tl.improve(lot.run, [*lot.model, "third_order"], fresh=lot.fresh.dwells.query("unit != 'DEMO-1'"))
    assert tl.read(dwells.set_index(["unit", "dwell"])).dwells[dwells.columns].equals(tl.read(dwells).dwells)


@pytest.mark.usefixtures("no_next_measurement")
def test_effects_are_a_list_or_a_text_and_never_silently_the_default_model(lot: tl.Example) -> None:
    fit = tl.fit(lot.run, "bias, scale")
    assert fit.effects == tl.fit(lot.run, ["bias", "scale"]).effects == ["bias", "scale"]
    # without a model a run is judged against its own, as by the command
    assert tl.diagnose(fit.recording).document["effects"] == tl.fit(fit.recording).effects == fit.effects
    for judge in (tl.fit, tl.diagnose, tl.improve):
        with pytest.raises(tl.TumblelineError, match="unknown effect 'scal'; did you mean scale"):
            judge(lot.run, ["bias", "scal"])
        for nothing in ([], "", 5):
            with pytest.raises(tl.WrongUse, match="ids of effects are needed"):
                judge(lot.run, nothing)
    force = fit.correct(np.array([0.0, 0.0, 1.0]), unit="DEMO-1", temperature=25.0)
    assert len(force) == 1
    for samples, stated, message in (
        (np.zeros((5, 2)), {}, r"\(5, 2\), \(n, 3\)"),
        (np.zeros((5, 3)), {"temperature": [1.0, 2.0]}, "temperature of shape"),
        (np.zeros((5, 3)), {"rate_hz": 0.0}, "rate_hz=0"),
    ):
        with pytest.raises(tl.WrongUse, match=message):
            fit.correct(samples, unit="DEMO-1", **stated)
    with pytest.raises(tl.WrongUse, match="export: nominl is no setting; did you mean nominal"):
        fit.export("c", nominl=1.0)


def test_a_name_is_imported_when_it_is_used() -> None:
    done = subprocess.run([sys.executable, "-c", LIGHT], cwd=ROOT, capture_output=True, text=True, check=True)
    seconds, *modules = done.stdout.split()
    assert float(seconds) < 0.3
    assert not {"numpy", "pandas", "prefect", "stations"} & set(modules)
    for name in tl.__all__:
        assert inspect.getdoc(getattr(tl, name)), name
    with pytest.raises(AttributeError, match="it has ArchiveView"):
        _ = tl.nothing


WITHOUT = """
import sys
for name in ("fcntl", "termios", "resource", "prefect"):
    sys.modules[name] = None
from pathlib import Path
from types import SimpleNamespace
import tumbleline as tl
from pipelines.diagnosis import diagnose
diagnose.proposed = lambda _: SimpleNamespace(rows=list)  # which is most of the time
run = tl.read(Path("dwells.csv"), archive="archive")
fit = tl.fit(run)
diagnosis = tl.diagnose(run, fit)
assert diagnosis.adequate is not None
diagnosis.report("report.html")
from pipelines.importers import files
assert len(files.read(Path("dwells.csv"))[0])
from pipelines.workbench import application
print(len(tl.archive("archive").runs))
"""


@pytest.mark.slow
def test_the_desk_side_needs_no_module_that_windows_lacks(lot: tl.Example, tmp_path: Path) -> None:
    lot.run.dwells.query("unit == 'DEMO-1'").to_csv(tmp_path / "dwells.csv", index=False)
    pipes = {"cwd": tmp_path, "env": {"PYTHONPATH": str(ROOT)}, "capture_output": True, "text": True}
    done = subprocess.run([sys.executable, "-c", WITHOUT], check=False, **pipes)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "2"


FILES = sorted(notebooks.FOLDER.glob("*.ipynb"))


def kinds(notebook: dict[str, Any]) -> list[list[str]]:
    """The forms of output of every cell."""
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return [[form for one in cell["outputs"] for form in one.get("data", {one["output_type"]: ""})] for cell in cells]


@pytest.mark.slow  # what they do with the package: tests/e2e/test_python.py
@pytest.mark.parametrize("path", FILES, ids=lambda one: one.stem)
def test_a_notebook_runs_and_shows_what_it_did(path: Path) -> None:
    assert len(FILES) == 3
    kept = json.loads(path.read_text(encoding="utf-8"))
    # it checks itself against its truth
    assert any("assert" in line for cell in kept["cells"] for line in cell["source"])
    assert kinds(notebooks.run(path)) == kinds(kept)
    assert "<svg" in path.read_text(encoding="utf-8")
    assert str(Path.home()) not in path.read_text(encoding="utf-8")
