"""Outputs that follow their supply: the supplies of the slots, their measurement, and what is left in the budget."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from each import each
from in_process import given, refused, text_of
from root_process import ROOT
from small_station import lot_of, plant_of, station_of

from pipelines.archive import Archive
from pipelines.chain.runner import Runner
from pipelines.jobs.job import Request
from pipelines.jobs.terms import planned_terms, without_noise
from pipelines.planning.context import noise_of
from pipelines.stages.reduce import FollowedSupply, at_nominal_supply
from pipelines.stages.uncertainty.reachable import reachable
from schemas.decisions import decide
from schemas.errors import DataRejected, RecipeInvalid
from schemas.units import AXES
from stations.opening import make_plant
from stations.plant.noise import UnitNoise
from stations.plant.preset import load_preset
from tumbleline import Calibration

RECIPE = ROOT / "deploy" / "recipes" / "analogue.toml"
STATION = ROOT / "deploy" / "stations" / "simulated.toml"
UNITS = tuple(f"C{k}" for k in range(6))


def changed(folder: Path, source: Path, **texts: str) -> Path:
    text = source.read_text(encoding="utf-8")
    for old, new in texts.values():
        assert old in text
        text = text.replace(old, new)
    (folder / source.name).write_text(text, encoding="utf-8")
    return folder / source.name


def readings(plant, at_s: list[int]) -> np.ndarray:
    """Supplies (n, slots) that the meter reads at whole seconds, over the nominal voltage."""
    rows, now = [], 0
    for second in at_s:
        plant.advance(1_000_000 * (second - now))
        now = second
        rows.append(plant.supply_reading()[:3])
    return np.array(rows) / plant.preset.supply_V


def of_analogue(at_s: list[int], device: str = "analogue", **simulation: float) -> np.ndarray:
    return readings(plant_of(station_of(**simulation), lot_of(device=device)), at_s)


def test_the_supply_of_each_slot_drifts_and_its_output_with_it_unless_a_device_rejects_it():
    read = of_analogue(list(range(60, 30_000, 600)), supply_drift=1e-3)
    assert np.all(read.std(axis=0) > 3e-4)
    assert np.abs(np.corrcoef(read.T)[0, 1]) < 0.9
    assert np.all(of_analogue(list(range(60, 6_000, 600)), supply_drift=0.0).std(axis=0) < 5e-5)
    plain, drifting = (of_analogue([60, 6_000], "ADXL355", supply_drift=drift) for drift in (0.0, 1e-3))
    assert np.array_equal(plain, drifting)
    exact, wrong = (of_analogue([60], supply_reading_ppm=ppm) for ppm in (0.0, 1000.0))
    ratio = (wrong / exact)[0]
    assert np.ptp(ratio) < 1e-6  # the meter has one gain error for all slots
    assert abs(ratio[0] - 1.0) > 1e-5


def dwells(supply: float) -> pd.DataFrame:
    numbers = {"out_x": 1.503, "out_y": 1.2024, "out_z": 1.8036, "sd_x": 1e-3, "sd_y": 1e-3, "sd_z": 1e-3}
    return pd.DataFrame([{"unit": "A", "dwell": 4, "slot": 2, "supply_V": supply, **numbers}])


def test_dwells_are_referred_to_the_nominal_supply_the_level_at_0_g_included():
    whole = at_nominal_supply(dwells(3.006), FollowedSupply(3.0, 1.0)).iloc[0]
    assert [whole[f"out_{axis}"] for axis in AXES] == pytest.approx([1.5, 1.2, 1.8], rel=1e-12)
    assert whole["sd_x"] == pytest.approx(1e-3 / 1.002)
    half = at_nominal_supply(dwells(3.006), FollowedSupply(3.0, 0.5)).iloc[0]
    assert half["out_x"] == pytest.approx(1.503 / 1.001)


def test_a_supply_that_is_not_known_is_refused_by_name(tmp_path: Path):
    for supply in (0.0, float("nan")):
        with pytest.raises(DataRejected, match=r"unit A, dwell 4: supply .* V, a measured supply is needed.*slot 2"):
            at_nominal_supply(dwells(supply), FollowedSupply(3.0, 1.0))
    changed(tmp_path, RECIPE.with_name("analogue.limits.toml"))
    recipe = changed(tmp_path, RECIPE, supply=("supply_V = 3.0\n", ""))
    with pytest.raises(RecipeInvalid, match=r"'stability\.supply_V': missing, station simulated measures the supply"):
        Request(recipe=str(recipe), station=STATION).job()


def test_the_supply_counts_with_the_level_at_0_g():
    job = Request(recipe=str(RECIPE), station=STATION).job()
    terms = planned_terms(job.recipe, job.station, job.limits)
    half = replace(terms, stability=terms.stability.model_copy(update={"ratiometric": 0.5}))

    def supply(terms) -> dict[tuple[str, str], float]:
        reaches = reachable(without_noise(job.recipe, job.station), terms, job.recipe.effects)
        return {(one.quantity, one.axis): one.parts.get("supply", 0.0) for one in reaches}

    assert supply(terms)["bias", "x"] == pytest.approx(20.0 * 5.0, rel=1e-3)  # 20 ppm of 1.5 V / 0.3 V/g
    assert supply(terms)["scale", "x"] == pytest.approx(20.0, rel=1e-3)
    assert supply(half)["bias", "x"] == pytest.approx(50.0, rel=1e-3)


MEASURED = 'supply = { u_ppm = 20.0, ratio_measured = true, scope = "station", source = "supply_reading_ppm of the simulation" }'


@each([("--direct",), ()], repr)
def test_limits_that_no_unit_can_meet_are_told_before_an_order_is_sent(
    how: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The supply is not measured, and the seat of 1 mrad leaves a misalignment of 1 mrad undecided: one message, no order."""
    asked: list[str] = []
    for name in ("make_plant", "open_station"):
        monkeypatch.setattr(f"stations.opening.{name}", lambda *_, own=name, **__: asked.append(own))
    unmeasured = 'supply = { u_ppm = 1000.0, scope = "slot", source = "spread" }'
    station = changed(tmp_path, STATION, supply=(MEASURED, unmeasured))
    changed(tmp_path, RECIPE.with_name("analogue.limits.toml"), seat=("max = 40.0", "max = 1.0"))
    words = ("run", changed(tmp_path, RECIPE), "--station", station, "--archive", tmp_path / "archive")
    status, _, told = given(*words, *how)
    assert (status, len(told.strip().splitlines())) == (2, 1)
    for text in (
        "bias_error_ug: limit 1000 µg, U (k = 2) 10600 µg (supply 100 %)",
        "misalignment_mrad: limit 1 mrad, U (k = 2) 2 mrad (seat of the fixture 100 %)",
        "nothing was moved", "analogue.limits.toml",
        "measure that of each slot, supply = { u_ppm = …, ratio_measured = true }",
    ):  # fmt: skip
        assert text in told
    assert not asked
    assert not (tmp_path / "archive" / "captures").exists()


@pytest.fixture(scope="module")
def lot(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """A lot with dwells of 3 s: the run, and the truth of its units."""
    folder = tmp_path_factory.mktemp("lot")
    station = changed(folder, STATION, seed=("seed = 1\n", "seed = 21\n"))
    changed(folder, RECIPE.with_name("analogue.limits.toml"))
    recipe = changed(folder, RECIPE, dwell=("dwell_s = 10.0", "dwell_s = 3.0"))
    store = Archive(folder / "archive")
    job = Request(recipe=str(recipe), station=station, units=UNITS, seed=21).job(store)
    runner = Runner(job, store, lambda *_: None)
    for stage in ("capture", "validate", "reduce", "fit", "verify", "noise", "procedures", "budget", "grade"):
        runner.stage(stage)
    plant = make_plant(job.station, job.lot)
    truths = {unit: plant.truth(unit) for unit in UNITS}
    return SimpleNamespace(run=runner.run, truths=truths, preset=plant.preset)


@pytest.mark.slow
def test_a_lot_fails_by_its_own_errors_alone_and_its_true_bias_and_scale_lie_within_their_uncertainty(
    lot: SimpleNamespace,
):
    limits = Request(recipe=str(RECIPE), station=STATION).job().limits
    # a unit whose uncertainty exceeds the limit is not told to be measured longer
    assert "lower its largest contribution" in decide(limits, "bias_error_ug", 120.0, 650.0).sentence
    assert "measure longer, or again" in decide(limits, "bias_error_ug", 700.0, 250.0).sentence
    failed = lot.run.table("grades").query("outcome != 'pass'")
    assert len(failed) <= 1
    assert all("bias_temperature_ug_K fail" in reason for reason in failed["reasons"])
    within, size = [], []
    of = lot.run.table("coefficients").set_index(["unit", "axis", "effect"])["value"]
    expanded = lot.run.table("uncertainties").set_index(["unit", "axis", "quantity"])["expanded"]
    for unit, truth in lot.truths.items():
        for k, axis in enumerate(AXES):
            scale = lot.preset.scale * (1.0 + 1e-6 * truth.scale_ppm[k])
            bias = lot.preset.zero_level + lot.preset.scale * truth.bias_g[k]
            for name, true in (("bias", bias), ("scale", scale)):
                error = 1e6 * (of[unit, axis, name] - true) / scale
                within.append(abs(error) <= expanded[unit, axis, name])
                size.append(abs(error))
    # 36 figures; 0.75 with uncertainties half as large. The units share the error of their meter: of this station 0.7 u
    assert np.mean(within) >= 0.9
    assert np.max(size) < 1000.0  # without the measurement the spread of the supplies is 5000 µg of bias


@pytest.mark.slow
def test_a_recording_at_another_supply_is_corrected_to_the_same_force(lot: SimpleNamespace, tmp_path: Path):
    dwells = lot.run.table("dwells")
    own = dwells[(dwells["unit"] == "C0") & (dwells["kind"] == "dwell")].sort_values("time_s")
    columns = ["time_s", "out_x", "out_y", "out_z", "unit_C"]
    raw = own[columns].assign(supply_V=2.97)  # the dwells are at 3 V: at 2.97 V each output is a hundredth lower
    raw[["out_x", "out_y", "out_z"]] *= 0.99
    raw.to_csv(tmp_path / "raw.csv", index=False)
    archive = ("--archive", lot.run.path.parents[1], "--include", "failed")
    correct = (f"{lot.run.id}:C0", *archive)
    text_of("correct", tmp_path / "raw.csv", *correct, "--output", tmp_path / "corrected.csv", status=0)
    force = pd.read_csv(tmp_path / "corrected.csv")[[f"force_{axis}_g" for axis in AXES]].to_numpy()
    assert np.abs(force - own[[f"force_{axis}" for axis in AXES]].to_numpy()).max() < 1e-3
    ours = Calibration(lot.run).correct(raw, unit="C0")[[f"force_{axis}_g" for axis in AXES]]
    assert np.abs(ours.to_numpy() - force).max() < 1e-9
    with pytest.raises(DataRejected, match="add a column supply_V"):
        Calibration(lot.run).correct(raw.drop(columns="supply_V"), unit="C0")
    raw.drop(columns="supply_V").to_csv(tmp_path / "bare.csv", index=False)
    assert "add a column supply_V" in refused("correct", tmp_path / "bare.csv", *correct)
    assert "the coefficients hold at 3 V of supply" in given("export", lot.run.id, *archive, "--format", "json")[2]


def test_a_plan_counts_the_noise_that_sampling_folds():
    job = Request(recipe=str(RECIPE), station=STATION).job()
    preset = load_preset("analogue")
    slow, fast = (
        noise_of(job.recipe.model_copy(update={"rate_hz": rate}), "", None, None).density for rate in (100.0, 4000.0)
    )
    assert fast == pytest.approx(280e-6, rel=0.01)
    streams = [np.random.default_rng([9, k]) for k in range(40)]
    means = UnitNoise(preset, streams).sample(2000, 100.0).reshape(20, 100, -1).mean(axis=1)
    assert means.std() == pytest.approx(slow / np.sqrt(2.0), rel=0.05)
