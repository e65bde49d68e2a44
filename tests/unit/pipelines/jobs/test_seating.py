"""Which unit sits in which slot: by list, by file, by scan."""

from pathlib import Path

import pytest
from capture_double import recipe_file
from each import each
from root_process import ROOT

from pipelines.jobs.job import Request
from pipelines.jobs.seating import Seating, read_seating
from schemas.errors import RecipeInvalid, WrongUse


def written(folder: Path, name: str, text: str) -> str:
    (folder / name).write_text(text, encoding="utf-8")
    return str(folder / name)


def test_a_list_sits_slot_by_slot_and_a_slot_map_says_where_each_unit_sits(tmp_path: Path) -> None:
    assert read_seating("A1, A2,A3") == Seating(("A1", "A2", "A3"))
    assert read_seating("") == Seating()
    for name, text in (
        ("map.csv", "slot,serial\n5,A5\n 2 , A2\n\n"),
        ("map.csv", "Slot,Serial,remark\n5,A5,new\n2,A2,\n"),
        ("map.csv", "\ufeffslot;serial\r\n5;A5\r\n\r\n2;A2\r\n;\r\n"),  # as spreadsheets write it
        ("map.csv", "slot\tserial\n5\tA5\n2\tA2"),
        ("map.toml", '[slots]\n5 = "A5"\n2 = "A2"\n'),
    ):
        assert read_seating(written(tmp_path, name, text)) == Seating(("A5", "A2"), (5, 2))


@each([
    ("map.csv", "A1\nA2\n", "begins with 'a1', a first line 'slot,serial' is needed"),
    ("map.csv", "slot,serial\nx,A1\n", "row 1: slot 'x', a whole number"),
    ("map.csv", "slot,serial\n-1,A1\n", "row 1: slot '-1', a whole number"),
    ("map.csv", "slot,serial\n1,A1\n1,A2\n", "row 2: slot 1 is there twice"),
    ("map.csv", "slot,serial\n1,\n", "slot 1 has no serial number"),
    ("map.csv", "slot,serial\n", "no slot has a unit"),
    ("map.csv", "slot,serial\n0,A1\n1\n", "row 2: 1 cells"),
    ("map.csv", "slot,serial\n0,A1\n1;B2\n", "row 2: 1 cells"),
    ("map.csv", "slot,serial\n0,A1\n1,B2,C3\n", "row 2: 3 cells"),
    ("map.csv", "slot,serial\n0,A1\n1,A1\n", "serial A1 is there twice"),
    ("map.csv", "slot,serial\n0,..\n", "serial '..' is not usable"),
    ("map.csv", "slot,serial\n0,=cmd|x\n", r"serial '=cmd\|x' is not usable"),
    ("map.csv", "slot,serial\n0,АВ\n", r"U\+0410"),
    ("map.csv", "slot,serial\n٣,A1\n", "slot '٣', a whole number"),
    ("map.csv", f"slot,serial\n{'9' * 5000},A1\n", "a whole number from 0 on"),
    ("map.csv", f"slot,serial\n0,{'x' * 200000}\n", "not a table of text|too long"),
    ("map.toml", "[slots]\n0 = true\n", "slot 0: found True, a serial number in quotes is needed"),
    ("map.toml", "seats = 1\n", r"no table \[slots\]"),
    ("map.toml", "slots = [", "not valid TOML"),
])  # fmt: skip
def test_refuses_slot_maps_with_a_slip(row: tuple[str, str, str], tmp_path: Path) -> None:
    name, text, words = row
    with pytest.raises((WrongUse, RecipeInvalid), match=words) as refused:
        read_seating(written(tmp_path, name, text))
    assert len(str(refused.value)) < 400 + len(str(tmp_path))
    with pytest.raises(RecipeInvalid, match=r"slot map: .*none\.csv cannot be read"):
        read_seating(str(tmp_path / "none.csv"))


def test_a_job_has_its_units_where_the_slot_map_says(tmp_path: Path) -> None:
    request = Request(recipe=recipe_file(tmp_path), units=("A5", "A2"), slots=(5, 2))
    assert [(unit.serial, unit.slot) for unit in request.job().lot.units] == [("A5", 5), ("A2", 2)]
    with pytest.raises(WrongUse, match="unit A9 in slot 9, the fixture of station simulated has slots 0 to 7"):
        Request(recipe=recipe_file(tmp_path), units=("A9",), slots=(9,)).job()


def test_faults_of_the_command_line_and_the_recipe_become_the_stations(tmp_path: Path) -> None:
    recipe = recipe_file(tmp_path, ("seed = 5", 'seed = 5\nfaults = [{ kind = "door", at_s = 9000.0, for_s = 60.0 }]'))
    job = Request(recipe=recipe, faults=("silent:serial=A2:at_s=500", "vibration:rms_g=0.5")).job()
    assert [fault.kind for fault in job.station.simulation.faults] == ["door", "silent", "vibration"]
    assert job.station.simulation.faults[2].figures == {"rms_g": 0.5}
    assert job.capture_id != Request(recipe=recipe_file(tmp_path)).job().capture_id


@each([
    ("sillent:serial=A1", "did you mean silent"),
    ("silent:serial=A9", "no unit 'A9'"),
    *((fault, "correct the fault") for fault in ("silent", "dead", "door:serial=A1", "mute:serial=A1:device=reader")),
    ("silent:serial", "found 'serial', key=value is needed"),
    ("door:at_s=soon", "at_s: input should be a valid number"),
    ("vibration:rms=1", "no figure 'rms'; did you mean rms_g"),
])  # fmt: skip
def test_refuses_faults_with_a_slip(row: tuple[str, str], tmp_path: Path) -> None:
    fault, words = row
    with pytest.raises((WrongUse, RecipeInvalid), match=words):
        Request(recipe=recipe_file(tmp_path), faults=(fault,)).job()
    with pytest.raises(WrongUse, match="a simulated station is needed"):
        Request(recipe=recipe_file(tmp_path), station=ROOT / "deploy/stations/line-1.toml", faults=("door",)).job()
