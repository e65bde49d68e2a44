"""Mountings of a centrifuge: ordered at standstill only, confirmed by the machine, and felt at their own radius."""

import math
from pathlib import Path

import numpy as np
import pytest
from procedure_records import procedure_records
from root_process import ROOT
from small_station import MemorySink, captured, plant_of

from pipelines.jobs.recipes import load_limits, load_recipe
from pipelines.procedures import PROCEDURES, figures_of_recipe, parts_of, refuse_unusable, roles_of
from schemas.errors import OperatorNeeded, RecipeInvalid, StationRefused
from schemas.lot import Lot, Unit
from schemas.profile import Profile
from schemas.recipe import Recipe
from schemas.station import load_station
from stations import open_station
from stations.plant.families.acutrol_3000 import Centrifuge, radius_error

LOT = Lot(units=[Unit(serial="C1", slot=0), Unit(serial="C2", slot=1)], device="SF1500", seed=5)
RATE = math.degrees(math.sqrt(20.0 * 9.80665 / 0.3))


@pytest.fixture
def machine():
    with open_station(load_station(), LOT, roles=["centrifuge"]) as station:
        yield station.equipment["centrifuge"]


def orders(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, float]]:
    """Each changing line that the simulated machine hears, with the rate at that instant."""
    heard: list[tuple[str, float]] = []
    answer = Centrifuge.answer

    def noted(self: Centrifuge, line: str) -> tuple[str, bool]:
        heard.append((line, self.rate()))
        return answer(self, line)

    monkeypatch.setattr(Centrifuge, "answer", noted)
    return heard


def test_units_are_mounted_at_standstill_with_the_interlock_open(machine, monkeypatch: pytest.MonkeyPatch) -> None:
    heard = orders(monkeypatch)
    machine.spin(400.0, 1, 0.5, [0, 1], 0.5)
    machine.spin(600.0, 1, 0.5, [0, 1], 0.5)
    assert not [line for line, _ in heard if line.startswith((":mount 1,", ":radius 1,", ":int:open"))]
    machine.spin(400.0, -1, 0.5, [0, 1], 0.3)
    changed = [(line, rate) for line, rate in heard if line.startswith((":mount 1,", ":radius 1,"))]
    assert [line for line, _ in changed] == [":mount 1,-1", ":radius 1,0.300000"]
    assert all(abs(rate) < 0.01 for _, rate in changed)
    at = [line for line, _ in heard]
    assert at.index(":int:open 1") < at.index(":mount 1,-1")
    with pytest.raises(StationRefused, match="NA:PARA ERR"):
        machine.values.write("radius", 0.5)  # it turns
    heard.clear()
    without_radius(monkeypatch, type(machine.values))  # a machine that has no command for it is not told
    machine.spin(400.0, 1, 0.5, [0, 1], 0.3)
    assert not any("radius" in line for line, _ in heard)


def test_the_units_feel_the_acceleration_of_the_radius_that_was_ordered(machine) -> None:
    far = machine.spin(RATE, 1, 1.0, [0, 1], 0.5)
    near = machine.spin(RATE, 1, 1.0, [0, 1], 0.3)
    for slot in (0, 1):
        output = [recording.outputs[slot][:, 2].mean() / 0.007 for recording in (far, near)]
        assert output[0] - output[1] == pytest.approx(20.0 * (0.5 / 0.3 - 1.0), rel=0.02)
    again = machine.spin(RATE, 1, 1.0, [0, 1])  # where no radius is ordered it stays
    assert again.outputs[0][:, 2].mean() == pytest.approx(near.outputs[0][:, 2].mean(), rel=1e-4)


def test_a_mounting_that_is_not_confirmed_asks_for_the_operator_and_goes_on_afterwards(
    machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    mount = Centrifuge._mount
    monkeypatch.setattr(Centrifuge, "_mount", lambda *_: ("OK", True))  # a machine that waits for a person
    with pytest.raises(OperatorNeeded, match=r"mounted the other way round at 0\.3 m are needed"):
        machine.spin(400.0, -1, 0.5, [0, 1], 0.3)
    assert machine.values.number("rate_read") == 0.0
    monkeypatch.setattr(Centrifuge, "_mount", mount)
    recording = machine.spin(400.0, -1, 0.5, [0, 1], 0.3)
    assert np.mean(recording.outputs[0][:, 2]) < 0.0


def without_radius(monkeypatch: pytest.MonkeyPatch, of: type) -> None:
    """A machine that cannot be told the radius."""
    has = of.has
    monkeypatch.setattr(of, "has", lambda self, name: name != "radius" and has(self, name))


HEAD = (
    'name = "r"\ndevice = "SF1500"\nlocal_gravity_m_s2 = 9.80665\ntemperatures_C = [25.0]\n'
    '[[procedures]]\nkind = "centrifuge"\n'
)
PART = "scale = 0.007\nrecord_s = 1.0\nforces_g = [2.0, 10.0, 20.0, 30.0]\ndown_again = false\n"
RADII = "radii_m = [0.5, 0.3]\n"


def recipe_of(folder: Path, more: str) -> Recipe:
    path = folder / "recipe.toml"
    path.write_text(HEAD + PART + more)
    return load_recipe(str(path))


def taken(recipe: Recipe, sink: MemorySink | None = None) -> MemorySink:
    return captured(recipe, LOT, sink=sink, roles=roles_of(recipe))


def figures(recipe: Recipe) -> dict[str, dict]:
    """Figures by unit and name, from the samples of a capture, with the texts of the findings."""
    records, device = procedure_records(recipe, taken(recipe))
    part, procedure = parts_of(recipe)[0], PROCEDURES["centrifuge"]
    outcome = procedure.evaluate(part, procedure.reduce(part, records, device), device)
    texts = {unit: " · ".join(f.text for f in outcome.findings if f.unit == unit) for unit in outcome.figures}
    return {
        unit: {one.figure: one for one in of_unit} | {"text": texts[unit]} for unit, of_unit in outcome.figures.items()
    }


def test_figures_at_two_radii_agree_with_what_arm_and_units_really_are(tmp_path: Path) -> None:
    by_unit, plant = figures(recipe_of(tmp_path, RADII)), plant_of(lot=LOT)
    holes = [1.0 + radius_error(plant.bench, r) / r for r in (0.5, 0.3)]
    for k, unit in enumerate(plant.serials):
        own, gain = plant.bench.units[k], 1.0 + 1e-6 * plant.truth(unit).scale_ppm[2]
        true = {
            "centrifuge_mass_offset_um": 1e6 * own.mass_offset_m,
            "centrifuge_radius_consistency_ppm": 1e6 * (holes[1] / holes[0] - 1.0),
            "centrifuge_sensitivity_percent": 100.0 * (gain - 1.0),
            "centrifuge_second_order_ug_g2": 1e6 * gain * own.quadratic[2],
            "centrifuge_third_order_ug_g3": 1e6 * gain * plant.truth(unit).cubic[2],
        }
        for name, value in true.items():
            one = by_unit[unit][name]
            assert abs(one.value - value) < 4.0 * one.uncertainty, (unit, name)
        assert by_unit[unit]["centrifuge_mass_offset_um"].uncertainty < 2.0
        assert "mass_offset: " in by_unit[unit]["text"]
        assert "does not separate it from" not in by_unit[unit]["text"]


def test_one_radius_leaves_the_offset_open_and_says_what_closes_it(tmp_path: Path) -> None:
    by_name = figures(recipe_of(tmp_path, "radius_m = 0.3\n"))["C1"]
    assert not by_name["centrifuge_mass_offset_um"].identified
    assert "radii_m" in by_name["centrifuge_mass_offset_um"].note
    one, true = by_name["centrifuge_sensitivity_percent"], 1e-4 * plant_of(lot=LOT).truth("C1").scale_ppm[2]
    assert abs(one.value - true) < 3.0 * one.uncertainty  # the station mounts at the radius of the recipe


@pytest.mark.slow
def test_a_capture_at_two_radii_that_stops_goes_on_bit_for_bit(tmp_path: Path) -> None:
    recipe = recipe_of(tmp_path, RADII)
    whole, broken = taken(recipe), MemorySink()
    for broken.die_after in (3, 7, 9):  # within a mounting, before the reversed one, and before the other radius
        with pytest.raises(KeyboardInterrupt):
            taken(recipe, broken)
    broken.die_after = 10**6
    taken(recipe, broken)
    assert broken.state == whole.state
    assert all(broken.all(part).equals(whole.all(part)) for part in range(3))


def test_radii_that_separate_nothing_are_refused(tmp_path: Path) -> None:
    for more, words in (
        (RADII + "radius_m = 0.5\n", "one of them is needed"),
        ("radii_m = [0.5, 0.501]\n", "closer than 2 %"),
        ("radii_m = [0.5]\n", "radii_m"),
        (RADII + "radius_um = 0.0\n", "state radius_um"),
    ):
        with pytest.raises(RecipeInvalid, match=words):
            parts_of(recipe_of(tmp_path, more))


def test_the_sample_of_two_radii_can_be_performed_by_a_centrifuge_that_can_be_told_the_radius(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = ROOT / "deploy" / "recipes" / "procedures" / "centrifuge_two_radii.toml"
    recipe = load_recipe(str(path))
    refuse_unusable(recipe, load_station())
    assert parts_of(recipe)[0].radii == (0.5, 0.3)
    assert set(load_limits(recipe, path.parent).figures) <= set(figures_of_recipe(recipe))
    without_radius(monkeypatch, Profile)
    with pytest.raises(RecipeInvalid, match="no command 'radius'"):
        refuse_unusable(recipe, load_station())
