"""Every test procedure that is found: documented, refused without its equipment, measured, resumed, true, decided, drawn."""

import re
from pathlib import Path

import numpy as np
import pytest
from each import each
from scipy import signal
from stopped_capture import Stopped, Stopping

from docs.procedures_page import page
from inertial.dynamics import spectra
from inertial.dynamics.transfer_effects import EFFECTS, Conditions
from inertial.dynamics.transfer_model import Points, fit_transfer
from pipelines.archive import Archive
from pipelines.capture.capture import capture
from pipelines.chain.runner import Runner
from pipelines.jobs.job import Job
from pipelines.jobs.recipes import load_recipe
from pipelines.procedures import (
    FIGURES,
    PROCEDURES,
    figures_of_recipe,
    parts_of,
    refuse_unusable,
    roles_of,
)
from pipelines.procedures.base import Evaluated, OnEquipment, SetsEquipment
from pipelines.procedures.transfer_figures import bandwidth_of
from pipelines.report.unit_panels.procedures import picture
from pipelines.schedule.steps import steps
from pipelines.stages.figures import UNITS
from schemas.errors import RecipeInvalid
from schemas.limits import limits_of
from schemas.lot import Lot, Unit
from schemas.progress import silent
from schemas.station import load_station
from schemas.station_devices import Equipment
from stations import open_station
from stations.plant.bench import Bench, DynamicTruth
from stations.plant.plant import Plant

HOW_TO = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "list-procedures.md"
SF1500 = 0.007  # V per g
PARTS = {
    "tilt": "step_deg = 60.0\norders = 1",
    "rotation": f"rates_deg_s = [30.0]\nscale = {SF1500}",
    "bias_stability": f"lasting_s = 1000.0\nrate_hz = 2.0\nscale = {SF1500}",
    "warm_up": f"band_ug = 3000.0\noff_s = 60.0\nlasting_s = 120.0\nscale = {SF1500}",
    "turn_on": f"cycles = 3\noff_s = 10.0\nwarm_up_s = 1.0\nwindow_s = 5.0\nscale = {SF1500}",
    "exposure": f'profile = "mil_std_810_altitude"\nwindow_s = 2.0\nscale = {SF1500}',
    "sweep": f"low_hz = 20.0\nhigh_hz = 6000.0\nper_octave = 2\nnominal_scale = {SF1500}\nlevel_g = 2.0\nrecord_s = 0.1",
    "transverse": f"step_deg = 45.0\nrecord_s = 0.1\nscale = {SF1500}",
    "ratiometry": "supplies_V = [12.0, 10.5, 13.0]\ndwell_s = 5.0\nsettle_s = 1.0",
    "supply_ripple": f"lasting_s = 2.0\nfrequencies_hz = [100.0, 400.0]\nscale = {SF1500}",
    "step_response": "steps = 8",
    "shock": f"shocks = 1\nwindow_s = 10.0\nsettle_s = 1.0\nscale = {SF1500}",
    "centrifuge": f"record_s = 1.0\nscale = {SF1500}\ndown_again = false",
    "random_vibration": f"seconds = 4.0\nlevels_g = [1.0, 2.0, 3.0]\nwindow_s = 10.0\nscale = {SF1500}",
}
HEAD = """
name = "every-procedure"
device = "SF1500"
seed = 11
local_gravity_m_s2 = 9.80665
temperatures_C = [25.0]
"""
OWN = [name for name, one in PROCEDURES.items() if isinstance(one, Evaluated)]


def recipe_of(folder: Path, names: list[str]):
    path = folder / "recipe.toml"
    path.write_text(HEAD + "".join(f'\n[[procedures]]\nkind = "{name}"\n{PARTS[name]}\n' for name in names))
    return load_recipe(str(path))


def lot() -> Lot:
    return Lot(units=[Unit(serial="P1", slot=0), Unit(serial="P2", slot=3)], device="SF1500", seed=11)


def job_of(folder: Path, names: list[str]) -> Job:
    recipe = recipe_of(folder, names)
    limits = limits_of(
        {"name": "wide", "figures": {f.name: {"max": 1e9, "unit": f.unit} for f in figures_of_recipe(recipe).values()}},
        UNITS,
    )
    return Job(recipe, limits, lot(), load_station())


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory):
    """A lot through every procedure that has figures of its own."""
    folder = tmp_path_factory.mktemp("procedures")
    runner = Runner(job_of(folder, OWN), Archive(folder / "archive"))
    for _ in runner.all():
        pass
    return runner.run


@each(PROCEDURES)
def test_a_procedure_is_documented_and_can_do_what_its_steps_ask_for(name: str, tmp_path: Path) -> None:
    procedure, text = PROCEDURES[name], page()
    assert all((procedure.states, procedure.source, procedure.title, type(procedure).__doc__, procedure.part.__doc__))
    assert f"## {name}" in text
    assert [effect for effect in EFFECTS if f"`{effect}`" not in text] == []
    assert f"`{name}`" in HOW_TO.read_text(encoding="utf-8")
    own = load_steps(tmp_path, name) if name in PARTS else []
    orders = [step.order for step in own if step.order is not None and step.kind == "procedure"]
    assert bool(orders) == isinstance(procedure, Evaluated)
    assert {one.role for one in orders if one.role} <= set(procedure.roles)
    assert any(one.role and not one.on_table for one in orders) == isinstance(procedure, OnEquipment)
    assert any(one.on_table for one in orders) == isinstance(procedure, SetsEquipment)


@pytest.mark.slow
@each(FIGURES)
def test_a_figure_of_a_procedure_may_have_a_limit_and_is_decided(name: str, run) -> None:
    assert UNITS[name] == FIGURES[name].unit
    rows = run.table("procedure_figures")
    rows = rows[rows["figure"] == name]
    assert set(rows["unit"]) == {"P1", "P2"}
    decided = run.table("figures")
    known = rows[rows["identified"]]
    assert set(known["unit"]) == set(decided.loc[decided["figure"] == name, "unit"])
    for unit in rows.loc[~rows["identified"], "unit"]:
        reasons = run.table("grades").set_index("unit").loc[unit, "reasons"]
        assert f"{name}: not determined" in reasons


@pytest.mark.slow
def test_every_procedure_is_drawn_and_figures_agree_with_what_the_simulated_units_really_are(run) -> None:
    points, page = run.table("procedure_points"), run.report.read_text(encoding="utf-8")
    for name, part in zip(OWN, run.about["recipe"]["procedures"], strict=True):
        drawn = picture(PROCEDURES[name], {**part}, points[(points["procedure"] == name) & (points["unit"] == "P2")])
        assert "<svg" in drawn, name
        assert len(re.findall(r"<(?:path|use|circle|rect|line|polyline|text)\b", drawn)) > 10, name
        assert PROCEDURES[name].title in page
    figures = run.table("procedure_figures")
    plant = Plant(load_station(), lot())
    for k, unit in enumerate(("P1", "P2")):
        for name, true in truth_of(plant, k).items():
            row = figures[(figures["unit"] == unit) & (figures["figure"] == name)].iloc[0]
            if row["identified"]:
                assert abs(row["value"] - true) < 4.5 * row["uncertainty"], (unit, true, row.to_dict())
            elif np.isfinite(row["low"]):
                assert row["low"] <= true <= row["high"], (unit, name)
    assert figures["identified"].mean() > 0.8


@each([name for name, one in PROCEDURES.items() if one.roles])
def test_a_station_without_the_equipment_is_refused(name: str, tmp_path: Path) -> None:
    bare = load_station().model_copy(update={"equipment": Equipment(built_in=False)})
    with pytest.raises(RecipeInvalid, match=f"no {PROCEDURES[name].roles[0]}, one is needed"):
        refuse_unusable(recipe_of(tmp_path, [name]), bare)


@pytest.mark.parametrize("name", [one if one == "shock" else pytest.param(one, marks=pytest.mark.slow) for one in OWN])
def test_a_capture_that_stops_goes_on_bit_for_bit(name: str, tmp_path: Path) -> None:
    if len(load_steps(tmp_path, name)) < 2:
        pytest.skip("one record: there is nothing to resume")
    whole, broken = (Archive(tmp_path / part).capture("one") for part in ("whole", "broken"))
    take(tmp_path, name, whole)
    with pytest.raises(Stopped):
        take(tmp_path, name, Stopping(broken, 2))
    take(tmp_path, name, broken)
    assert broken.hash() == whole.hash()


def truth_of(plant: Plant, k: int) -> dict[str, float]:
    """What is true of a unit by the plant's physics, without any formula of the product's reduction."""
    bench: Bench = plant.bench
    dynamic, static = bench.units[k], plant._truths[k]
    grid = np.linspace(100.0, 4000.0, 400_001)
    gain = np.abs(dynamic.mass(grid) * dynamic.behind(grid))
    scale = 100.0 * ((1.0 + 1e-6 * static.scale_ppm[2]) - 1.0)
    g = plant.bench.gravity
    bend = 2.0 * dynamic.quadratic[2] * g + 3.0 * static.cubic[2] * g**2
    gain_all = 1.0 + 1e-6 * static.scale_ppm[2]
    shifts = [(volt / 12.0 - 1.0) for volt in (10.5, 13.0)]  # one is farther: of two as far, noise chooses the sign
    return {
        "transverse_sensitivity_percent": 100.0 * float(np.hypot(*static.misalignment[2, :2])),
        "supply_sensitivity_percent": 100.0 * max((static.supply_gain * one for one in shifts), key=abs),
        "supply_zero_ug_V": 1e6 * 0.05 / 12.0,
        **step_truth(dynamic),
        "sweep_bandwidth_hz": float(grid[np.flatnonzero(gain < np.sqrt(0.5))[0]]),
        "sweep_natural_hz": dynamic.natural_hz,
        "sweep_damping": dynamic.damping,
        "sweep_sensitivity_percent": scale - 100.0 * bench.rig.reference_error + 100.0 * bend,
        "shock_sensitivity_percent": scale,
        "centrifuge_second_order_ug_g2": 1e6 * dynamic.quadratic[2] * gain_all,
        "centrifuge_third_order_ug_g3": 1e6 * static.cubic[2] * gain_all,
    }


def step_truth(unit: DynamicTruth) -> dict[str, float]:
    """Settling to ± 2 % and rise of the chain by scipy: sprung mass, two-pole low-pass, delay, drive of 2 µs."""
    mass, pole = 2.0 * np.pi * unit.natural_hz, 2.0 * np.pi * unit.low_pass_hz
    chain = np.polymul([1.0 / mass**2, 2.0 * unit.damping / mass, 1.0], [1.0 / pole**2, np.sqrt(2.0) / pole, 1.0])
    time = np.linspace(0.0, 0.01, 100_001)
    out = signal.step(([1.0], np.polymul(chain, [2e-6, 1.0])), T=time)[1]
    outside = np.flatnonzero(np.abs(out - 1.0) > 0.02)[-1]
    ten, ninety = (time[np.flatnonzero(out > level)[0]] for level in (0.1, 0.9))
    return {
        "step_settling_ms": 1e3 * float(time[outside] + unit.delay_s - 2e-6 * np.log(2.0)),
        "step_overshoot_percent": 100.0 * float(out.max() - 1.0),
        "step_rise_ms": 1e3 * float(ninety - ten),
    }


def load_steps(folder: Path, name: str):
    return steps(recipe_of(folder, [name]))


def take(folder: Path, name: str, sink) -> None:
    recipe = recipe_of(folder, [name])
    with open_station(load_station(), lot(), resume=sink.last_state(), roles=roles_of(recipe)) as station:
        capture(station, recipe, lot(), sink, progress=silent, events=sink.events)


@each([('kind = "swep"', "sweep"), ('kind = "tilt"\nstep_deg = 17.0', "a whole number")])
def test_the_parts_are_checked_with_the_key_that_is_wrong(row: tuple[str, str], tmp_path: Path) -> None:
    path = tmp_path / "recipe.toml"
    path.write_text(f"{HEAD}\n[[procedures]]\n{row[0]}\n")
    with pytest.raises(RecipeInvalid, match=row[1]):
        parts_of(load_recipe(str(path)))


def test_the_band_edge_of_a_plain_second_order_model_is_the_closed_form() -> None:
    f = np.geomspace(10.0, 3000.0, 30)
    one = np.ones(30)
    points = Points(Conditions(f, one, one, one), -spectra.transfer(f, 1800.0, 0.65), 1e-3 * one, 1e-3 * one)
    fit = fit_transfer(points, ("second_order",))
    assert bandwidth_of(fit, fit.values, 3000.0) == pytest.approx(spectra.bandwidth(1800.0, 0.65), rel=1e-4)
