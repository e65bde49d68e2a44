"""Trouble at test equipment ends repeated, refused, or as not determined, and never as a figure."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from each import each
from long_suites import mostly_slow
from small_station import MemorySink, captured

from pipelines.archive import Archive, Run
from pipelines.chain.runner import Runner
from pipelines.jobs.job import Job
from pipelines.jobs.recipes import load_recipe
from pipelines.procedures import roles_of
from pipelines.stages.figures import UNITS
from schemas.errors import OperatorNeeded
from schemas.event import MemoryLog
from schemas.fault import FaultOrder
from schemas.limits import limits_of
from schemas.lot import Lot, Unit
from schemas.recipe import Recipe
from schemas.station import load_station, with_faults
from stations import open_station

LOT = Lot(units=[Unit(serial="F1", slot=0), Unit(serial="F2", slot=1)], device="SF1500", seed=5)
PARTS = {
    "sweep": "frequencies_hz = [40.0, 80.0, 120.0, 160.0, 320.0, 640.0, 900.0, "
    "1300.0]\nnominal_scale = 0.007\nlevel_g = 2.0\nrecord_s = 0.05\ncycles = 4",
    "shock": "shocks = 1\nboth_directions = false\nwindow_s = 10.0\nsettle_s = 0.0\nscale = 0.007",
    "centrifuge": "forces_g = [1.0, 5.0, 10.0, 20.0]\nrecord_s = 0.5\nreversed = false\ndown_again = false\nscale = 0.007",
    "step_response": "steps = 4",
    "ratiometry": 'supplies_V = [12.0, 11.0, 13.0]\naxes = ["z"]\ndwell_s = 2.0\nsettle_s = 0.0',
    "random_vibration": "seconds = 2.0\nlevels_g = [1.0, 2.0, 3.0]\nscale = 0.007",
    "transverse": "step_deg = 45.0\nrecord_s = 0.05\nscale = 0.007",
}  # fmt: skip


def recipe_of(folder: Path, name: str, more: str = "") -> Recipe:
    path = folder / "recipe.toml"
    path.write_text(
        'name = "trouble"\ndevice = "SF1500"\nlocal_gravity_m_s2 = 9.80665\ntemperatures_C = [25.0]\n'
        f'soak_min_s = 1.0\nallow_short_soak = true\n[[procedures]]\nkind = "{name}"\n{PARTS[name]}\n{more}'
    )
    return load_recipe(str(path))


def graded(folder: Path, recipe: Recipe, figure: str, limit: float, *faults: FaultOrder) -> Run:
    """A run of the recipe with one limit, up to its grades."""
    limits = limits_of({"name": "one", "figures": {figure: {"max": limit, "unit": UNITS[figure]}}}, UNITS)
    runner = Runner(Job(recipe, limits, LOT, with_faults(load_station(), list(faults))), Archive(folder / "archive"))
    for stage in ("capture", "validate", "reduce", "fit", "verify", "noise", "procedures", "budget", "grade"):
        runner.stage(stage)
    return runner.run


def take(recipe: Recipe, *faults: FaultOrder) -> tuple[MemorySink, MemoryLog]:
    sink, events, config = MemorySink(), MemoryLog(), with_faults(load_station(), list(faults))
    return captured(recipe, LOT, config, sink, events=events, roles=roles_of(recipe)), events


@cache
def undisturbed(name: str) -> tuple[float, set[int]]:
    """When the first recording on the equipment begins, s, and the records, of a run without a fault; once per process."""
    with TemporaryDirectory() as folder:
        good, _ = take(recipe_of(Path(folder), name))
    readings = good.all(1)
    return float(readings[readings["pose"] != "bias"]["start_s"].min()), good.finished()


SPOILT = {
    "sweep": ("missed_trigger", "clipped_reference", "level_not_reached", "reference_cable_off"),
    "shock": ("missed_trigger", "clipped_reference", "level_not_reached"),
    "step_response": ("missed_trigger", "level_not_reached"),
    "transverse": ("missed_trigger", "clipped_reference", "level_not_reached"),
    "random_vibration": ("missed_trigger", "clipped_reference", "level_not_reached"),
}
"""Equipment and how its recordings are spoilt."""
QUICK = {("sweep", "missed_trigger"), ("shock", "missed_trigger")}


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        pytest.param(name, kind, marks=() if (name, kind) in QUICK else pytest.mark.slow)
        for name, kinds in SPOILT.items()
        for kind in kinds
    ],
)
def test_a_spoilt_recording_is_discarded_and_repeated(name: str, kind: str, tmp_path: Path) -> None:
    first, finished = undisturbed(name)
    fault = FaultOrder(kind=kind, at_s=max(0.0, first - 0.2), for_s=0.6)
    again, events = take(recipe_of(tmp_path, name), fault)
    assert again.finished() == finished
    spoilt = next(event for event in events.recorded() if event.kind == "spoilt")
    assert {"shock": "shock", "step_response": "step generator"}.get(name, "exciter") in spoilt.reason


TROUBLE = {
    ("sweep", "missed_trigger"): "trigger was missed", ("sweep", "controller_abort"): "interlock open",
    ("shock", "guard_door"): "guard door is open", ("shock", "level_not_reached"): "was ordered",
    ("centrifuge", "guard_door"): "guard door", ("centrifuge", "overspeed"): "overspeed",
    ("centrifuge", "drive_runaway"): "runs away", ("centrifuge", "missed_trigger"): "trigger was missed",
    ("step_response", "level_not_reached"): "was ordered",
    ("step_response", "controller_abort"): "amplifier reports a fault",
    ("ratiometry", "current_limit"): "V measured, 13 V was set",
    ("random_vibration", "reference_cable_off"): "was ordered",
}  # fmt: skip


@each(TROUBLE)
def test_trouble_that_stays_ends_the_run_for_a_person(case: tuple[str, str], tmp_path: Path) -> None:
    with pytest.raises(OperatorNeeded, match=TROUBLE[case]):
        take(recipe_of(tmp_path, case[0]), FaultOrder(kind=case[1]))


FIGURE = {
    "sweep": "sweep_bandwidth_hz",
    "shock": "shock_sensitivity_percent",
    "centrifuge": "centrifuge_linearity_percent",
    "step_response": "step_settling_ms",
    "transverse": "transverse_sensitivity_percent",
    "random_vibration": "vibration_rectification_ug_g2",
}


@pytest.mark.parametrize("name", mostly_slow(FIGURE, "shock"))
def test_a_unit_whose_cable_is_off_has_no_figure(name: str, tmp_path: Path) -> None:
    figure = FIGURE[name]
    run = graded(tmp_path, recipe_of(tmp_path, name), figure, 1e9, FaultOrder(kind="cable_off", serial="F2"))
    figures = run.table("procedure_figures")
    of_units = figures[figures["figure"] == figure].set_index("unit")
    assert bool(of_units.loc["F1", "identified"]) or name == "sweep"
    assert not of_units.loc["F2", "identified"]
    assert np.isnan(of_units.loc["F2", "value"])
    assert run.table("grades").set_index("unit").loc["F2", "outcome"] == "fail"


@pytest.mark.slow
def test_a_shock_beyond_the_sheets_limit_changes_the_unit_for_good(tmp_path: Path) -> None:
    recipe = recipe_of(tmp_path, "shock", "peak_g = 14000.0\nduration_ms = 0.5\n")
    run = graded(tmp_path, recipe, "shock_bias_shift_ug", 5000.0)
    figures = run.table("procedure_figures").set_index(["unit", "figure"])
    assert abs(figures.loc[("F1", "shock_bias_shift_ug"), "value"]) == pytest.approx(250_000.0, rel=0.05)
    assert not figures.loc[("F1", "shock_sensitivity_percent"), "identified"]  # the pulse is beyond the range: it clips
    assert set(run.table("grades")["outcome"]) == {"fail"}


def test_a_centrifuge_that_is_left_alone_and_one_that_is_made_safe_stop(tmp_path: Path) -> None:
    recipe = recipe_of(tmp_path, "centrifuge")
    with open_station(load_station(), LOT, roles=roles_of(recipe)) as station:
        machine = station.equipment["centrifuge"]
        machine.spin(200.0, 1, 0.5, [0, 1])
        assert machine.values.number("rate_read") == pytest.approx(200.0)
        station.clock.sleep(2000.0)
        machine.values.text("fault")
        station.clock.sleep(30.0)
        assert machine.values.number("rate_read") == 0.0
        machine.spin(200.0, 1, 0.5, [0, 1])
        assert "centrifuge stopped" in station.make_safe().done
        station.clock.sleep(30.0)
        assert machine.values.number("rate_read") == 0.0
