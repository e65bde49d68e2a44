"""A table of dwells from elsewhere, as it is: without the scatter of samples, and with a bad dwell of one unit of a lot."""

import errno
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from in_process import command
from numpy.typing import NDArray

from inertial.effects import additions_forgotten
from inertial.frames import force_from_angles
from inertial.noise.flicker import flicker_kernel
from inertial.noise.measurands import walk_kernel
from pipelines.archive import Archive, Run
from pipelines.diagnosis.import_document import import_document
from pipelines.diagnosis.inputs import judged_effects
from pipelines.importers.keep import complete_table
from pipelines.integrity import verify
from pipelines.jobs.model_change import ModelChange, change_from_options
from pipelines.jobs.model_files import use_fitted_model
from pipelines.jobs.releases import model_digest
from pipelines.rerun.imported_fit import fit_document
from pipelines.rerun.reproduce import check
from pipelines.rerun.rerun import again
from pipelines.stages.fit import fit
from pipelines.stages.verify import verify as verified
from schemas.errors import ArchiveUnusable, DataRejected, RecipeInvalid, WrongUse

Array = NDArray[np.float64]
PLAIN = ("bias", "scale", "misalignment")
SPREAD_G = 5e-5
GAIN = 1.01
"""Output per g along each axis; the axes are square."""
BIAS_G = 0.02


def directions() -> Array:
    """Gravity (36, 3) in 18 directions, each twice."""
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    edges = [np.roll((0.0, one, other), turn) for turn in range(3) for one in (-1.0, 1.0) for other in (-1.0, 1.0)]
    return np.tile(np.concatenate([faces, np.array(edges) / np.sqrt(2.0)]), (2, 1))


def table(
    rng: np.random.Generator, root: Array | None = None, units: str = "ABC", force: Array | None = None
) -> pd.DataFrame:
    """A lot in the exchange format without sd and n, with noise of covariance ``root`` (n, n) times its transpose, g²."""
    force = directions() if force is None else force
    n = len(force)
    root = SPREAD_G * np.eye(n) if root is None else root
    made: list[pd.DataFrame] = []
    for unit in units:
        output = GAIN * force + BIAS_G + root @ rng.normal(size=(n, 3))
        columns = {"unit": unit, "dwell": range(n), "time_s": 40.0 * np.arange(n), "unit_C": 25.0}
        columns |= {f"force_{axis}": force[:, k] for k, axis in enumerate("xyz")}
        made.append(pd.DataFrame(columns | {f"out_{axis}": output[:, k] for k, axis in enumerate("xyz")}))
    return pd.concat(made, ignore_index=True)


def kept(folder: Path, dwells: pd.DataFrame, **how: object) -> Run:
    """The run that the import of a table of dwells leaves in the archive of a folder."""
    dwells.to_csv(folder / "lot.csv", index=False)
    archive = str(folder / "archive")
    return Archive(archive).run(import_document([folder / "lot.csv"], how, "", "", archive, None, nullcontext)["run"])


def errors_over_uncertainties(root: Array, seed: int, effect: str, lots: int = 8) -> Array:
    """Errors of an effect's coefficients in some lots over their standard errors."""
    rng = np.random.default_rng(seed)
    truth = {"bias": BIAS_G, "scale": GAIN}[effect]
    fits = [fit(complete_table(table(rng, root))[0], None, PLAIN)["coefficients"] for _ in range(lots)]
    rows = pd.concat(fits).query("effect == @effect")
    return ((rows["value"] - truth) / rows["standard_error"]).to_numpy()


@pytest.mark.slow
def test_errors_are_as_large_as_the_residuals_say_where_no_samples_tell_the_noise() -> None:
    """Within 2·u as often as k = 2 says; the scale under slow noises, of which a bias is no fixed number."""
    n = len(directions())
    time: Array = np.arange(0.0, 40.0 * n, 40.0)
    white: Array = np.eye(n)
    noises = {
        "white": white,
        "flicker": 0.2 * white + flicker_kernel(time),
        "walk": white + 4.0 * walk_kernel(time, np.ones(n, dtype=bool)),
    }
    roots = {name: SPREAD_G * np.linalg.cholesky(covariance) for name, covariance in noises.items()}
    found = {name: errors_over_uncertainties(root, 20 + k, "scale") for k, (name, root) in enumerate(roots.items())}
    found["bias"] = errors_over_uncertainties(roots["white"], 9, "bias")
    inside = {name: float(np.mean(np.abs(ratios) < 2.0)) for name, ratios in found.items()}
    assert all(share > 0.88 for share in inside.values()), inside  # 95 % less three deviations of 72 values
    # and they are not so large that they say nothing
    assert all(np.std(ratios) > 0.6 for ratios in found.values())


def test_a_curve_over_temperature_that_the_model_has_is_no_noise() -> None:
    """A bias that bends by 0.8 mg over the soaks, noise of 5 µg: the scatter about a plain fit is no measure of the noise."""
    rng = np.random.default_rng(4)
    model = (*PLAIN, "bias_temperature", "bias_temperature_quadratic")
    ratios: list[float] = []
    for _ in range(4):
        soaks: list[pd.DataFrame] = []
        for soak, warm in enumerate((0.0, 20.0, -20.0, 0.0)):
            part = table(rng, 5e-6 * np.eye(len(directions())))
            outputs = {name: part[name] + 1e-4 * warm + 2e-6 * warm**2 for name in ("out_x", "out_y", "out_z")}
            later = {"dwell": part["dwell"] + 36 * soak, "time_s": part["time_s"] + 5000.0 * soak}
            soaks.append(part.assign(unit_C=25.0 + warm, **outputs, **later))
        rows = fit(complete_table(pd.concat(soaks, ignore_index=True))[0], None, model)["coefficients"]
        rows = rows.query("effect == 'scale'")
        ratios += ((rows["value"] - GAIN) / rows["standard_error"]).tolist()
    assert 0.6 < np.std(ratios) < 1.5  # three deviations of 36 values


@pytest.mark.slow
def test_a_bad_dwell_of_one_unit_is_left_out_of_it_alone(tmp_path: Path) -> None:
    """As a diagnosis advises: the other units keep theirs, and their coefficients."""
    dwells = table(np.random.default_rng(5))
    dwells.loc[(dwells["unit"] == "B") & (dwells["dwell"] == 7), "out_y"] += 0.004
    dwells.loc[dwells["unit"] == "C", "out_x"] *= -1.0
    imported = kept(tmp_path, dwells, device="MY-1")
    archive = imported.archive
    whole = again(archive, imported.id, ModelChange())
    assert {archive.run(run).about["lot"]["device"] for run in (imported.id, whole.new)} == {"MY-1"}
    without = again(archive, imported.id, ModelChange(), left_out=(("B", 7),))
    bias = [
        run.table("coefficients").query("unit == 'B' and axis == 'y' and effect == 'bias'")["value"].item()
        for run in (archive.run(whole.new), archive.run(without.new))
    ]
    assert abs(bias[0] - BIAS_G) > 5e-5 > abs(bias[1] - BIAS_G)
    new = archive.run(without.new)
    assert set(new.about["left_out"]) == {"B:7"}
    assert set(new.table("dwells").query("dwell == 7")["unit"]) == {"A", "C"}
    document = fit_document(new, whole.new)
    assert document["faulty"] == ["C"]
    lines = "\n".join(document["lines"])
    assert "B lacks 7; units are fitted" in lines
    assert "\ndata fault of C (not judged): axis_flip, dwells all: x reads −x" in lines


def test_units_of_a_lot_with_gaps_are_fitted_on_what_they_have() -> None:
    """Those with the same dwells together, as a lot of their own; verified on the dwells that they have."""
    dwells = complete_table(table(np.random.default_rng(6)))[0]
    dwells.loc[dwells["dwell"].isin([3, 9]), "kind"] = "verification"
    gap = dwells[~((dwells["unit"] == "C") & dwells["dwell"].isin([3, 4]))]
    made = fit(gap, None, PLAIN)
    for units in (["A", "B"], ["C"]):
        alone = fit(gap[gap["unit"].isin(units)], None, PLAIN)
        for name in ("coefficients", "covariance", "residuals", "wander"):
            own = made[name][made[name]["unit"].isin(units)].reset_index(drop=True)
            pd.testing.assert_frame_equal(own, alone[name])
    tables = (made[name] for name in ("coefficients", "covariance", "predictions"))
    checked = verified(gap, None, *tables)["verification"]
    assert checked.groupby("unit")["dwell"].agg(list).to_dict() == {"A": [3, 9], "B": [3, 9], "C": [9]}
    assert (checked["error_ug"].abs() / checked["uncertainty_ug"]).max() < 4.0


def test_values_that_all_units_share_are_fitted_where_units_lack_dwells() -> None:
    """An encoder that is off by 0.2 mrad, found from all units; a unit without dwells has larger errors, and others theirs."""
    rng = np.random.default_rng(6)
    outer, inner = rng.uniform(-180.0, 180.0, (2, 40))
    force = force_from_angles(np.radians(outer) + 2e-4, np.radians(inner))
    made = table(rng, units="ABCD", force=force).drop(columns=["force_x", "force_y", "force_z"])
    dwells = complete_table(made.assign(outer_deg=np.tile(outer, 4), inner_deg=np.tile(inner, 4)))[0]
    model = (*PLAIN, "outer_encoder_offset")
    lacks = (dwells["unit"] + dwells["dwell"].astype(str)).isin(["C4", "C11", "C20", "A7"])
    whole, found = (fit(one, None, model)["coefficients"] for one in (dwells, dwells[~lacks]))
    offset = found.query("effect == 'outer_encoder_offset'")
    np.testing.assert_allclose(np.linalg.norm(dwells[["force_x", "force_y", "force_z"]], axis=1), 1.0)  # at the angles
    assert len(set(offset["value"])) == 1
    np.testing.assert_allclose(offset["value"], 2e-4, atol=2.5 * offset["standard_error"].iloc[0])
    both = found.merge(whole, on=["unit", "axis", "effect", "name"], suffixes=("", "_whole"))
    both["step"] = (both["value"] - both["value_whole"]) / both["standard_error"]
    steps = both.groupby("unit")["step"].agg(lambda one: float(np.sqrt(np.mean(one**2))))
    assert steps[["B", "D"]].max() < 0.05 < steps["A"] < steps["C"] < 1.0
    wider = both.query("effect == 'bias'").groupby("unit")[["standard_error", "standard_error_whole"]].mean()
    ratio = wider["standard_error"] / wider["standard_error_whole"]
    assert 1.02 < ratio["C"] < 1.12
    assert ratio[["B", "D"]].between(0.98, 1.02).all()


def test_a_model_that_a_unit_does_not_determine_is_named(rng: np.random.Generator) -> None:
    dwells = table(rng, units="AB")
    short = complete_table(dwells[(dwells["unit"] == "A") | (dwells["dwell"] < 3)])[0]
    with pytest.raises(DataRejected, match=r"unit B has 3 dwells, at least 4 are needed .*; leave the unit out"):
        fit(short.assign(outer_deg=0.0, inner_deg=0.0), None, [*PLAIN, "outer_encoder_offset"])


def test_a_table_is_completed_with_the_unit_that_its_outputs_show() -> None:
    dwells = table(np.random.default_rng(7), units="A")
    complete, told = complete_table(dwells)
    assert set(complete["out_unit"]) == {"g"}
    assert set(complete["kind"]) == {"dwell"}
    assert told[0].startswith("outputs in g: its norm is 1.0")
    in_mg = dwells.assign(**{f"out_{axis}": 1e3 * dwells[f"out_{axis}"] for axis in "xyz"})
    pd.testing.assert_frame_equal(complete_table(in_mg, "mg")[0], complete)
    volts = dwells.assign(**{f"out_{axis}": 0.3 * dwells[f"out_{axis}"] for axis in "xyz"})
    assert "out_unit" not in complete_table(volts)[0].columns
    assert set(complete_table(volts, "V")[0]["out_unit"]) == {"V"}
    with pytest.raises(WrongUse, match="output in 'gal': one of g, mg"):
        complete_table(dwells, "gal")


def test_an_import_of_a_table_of_dwells_takes_no_mapping_and_a_day_as_a_mapped_table(tmp_path: Path) -> None:
    dwells = table(np.random.default_rng(8), units="ABCD").assign(slot=3)
    keys = {"units": {"output": "g"}, "measured": "2026-11-20"}
    with pytest.raises(RecipeInvalid, match="threshold finds dwells in samples, each row is a dwell already"):
        kept(tmp_path, dwells, **keys, threshold=3.0)
    assert kept(tmp_path, dwells, **keys).about["measured"] == "2026-11-20"
    run = kept(tmp_path, dwells, units={"output": "mg"})
    assert run.table("dwells")["out_x"].max() < 2e-3
    assert [unit["slot"] for unit in run.about["lot"]["units"]] == [3, 3, 3, 3]
    assert run.about["name"] == "dwells of A, B, C, …"


def test_imported_dwells_are_fitted_with_the_plain_model_and_graded_where_limits_are_named(tmp_path: Path) -> None:
    imported = kept(tmp_path, table(np.random.default_rng(3), units="A"))
    archive = imported.archive
    outcome = again(archive, imported.id, ModelChange())
    assert outcome.because[0]["what"] == "not fitted yet"
    bias = archive.run(outcome.new).table("coefficients").query("effect == 'bias'")
    assert bias["value"].to_numpy() == pytest.approx(BIAS_G, abs=5e-5)
    assert check(archive, outcome.new).same
    assert again(archive, outcome.new, ModelChange()).new == outcome.new
    limits = tmp_path / "limits.toml"
    limits.write_text('name = "plain"\n[figures]\nzero_g_offset_mg = { max = 5.0, unit = "mg" }\n')
    change = change_from_options(limits=str(limits))
    (grade,) = archive.run(again(archive, imported.id, change).new).table("grades").to_dict("records")
    assert grade["outcome"] == "fail"
    assert "zero_g_offset_mg fail" in grade["reasons"]
    words = ("--archive", str(archive.root))
    limits.write_text('name = "wide"\n[figures]\nzero_g_offset_mg = { max = 50.0, unit = "mg" }\n')
    command(["fit", imported.id, "--limits", str(limits), *words])
    assert "yield   all 100 %, import 100 %" in command(["audit", *words]).stdout  # where a station's name would stand


GLUE = """
from inertial.effects import SensorEffect
from inertial.effects.base import stack


class Glue(SensorEffect):
    \"\"\"Glue.\"\"\"

    id = "glue"
    symbol = equation = source = breaker = "k"
    coefficients = ("k",)
    typical_ug = (1.0, 100.0)

    def columns(self, state, axis, **nonlinear):
        return stack(state, [state.along(axis) ** POWER])
"""


def test_a_changed_effect_file_is_another_fit_in_a_run_of_its_own(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The archive had the coefficients of the earlier file below the verdict on the later one."""
    run = kept(tmp_path, table(np.random.default_rng(8)))
    imported, archive = run.id, run.archive
    runs, evidence = list[str](), set[str]()
    for power in (2, 3, 3):
        own = tmp_path / f"glue_{len(runs)}.py"
        own.write_text(GLUE.replace("POWER", str(power)), encoding="utf-8")
        with additions_forgotten():
            change = change_from_options(",".join((*PLAIN, "glue")), effect_files=[own], where="fit")
            runs.append(again(archive, imported, change).new)
            evidence.add(model_digest(change))
            use_fitted_model(archive.run(runs[-1]), ())
            if power == 3:
                with pytest.raises(WrongUse, match="another state of the effect file"):
                    use_fitted_model(archive.run(runs[0]), ())
                caplog.clear()
                assert judged_effects(runs[0], str(tmp_path / "archive"), "", None, "diagnose") == [*PLAIN, "glue"]
                assert "another state of its file; this one is judged" in caplog.text
    assert runs[0] != runs[1] == runs[2]
    assert len(evidence) == 2  # what a release needs, too
    squared, cubed = (archive.run(name).table("coefficients").query("effect == 'glue'")["value"] for name in runs[:2])
    assert not np.allclose(squared, cubed)


@pytest.mark.parametrize("last", ["dwells.parquet", "dwells.json", "run.json"])
def test_a_full_disk_leaves_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, last: str) -> None:
    """A run of an import begins when its tables are there; the same import goes on where it was."""
    dwells = table(np.random.default_rng(8))

    def full(target: Path, data: bytes) -> None:
        if target.name == last:
            raise OSError(errno.ENOSPC, "No space left on device")
        target.write_bytes(data)

    with monkeypatch.context() as patched:
        patched.setattr("pipelines.archive.files._write_durably", full)
        with pytest.raises(ArchiveUnusable, match="No space left"):
            kept(tmp_path, dwells)
    archive = Archive(str(tmp_path / "archive"))
    assert archive.runs() == []
    assert verify(archive, keys={}).checked.findings == []
    assert len(kept(tmp_path, dwells).table("dwells")) == 108
    assert verify(archive, keys={}).checked.findings == []
