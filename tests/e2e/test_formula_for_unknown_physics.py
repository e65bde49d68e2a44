"""Physics of no catalogue: the user is told what follows what, adds the suggested formula, and the error falls."""

import json
import sys
from pathlib import Path

import pytest
from in_process import given

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from physics import OUTSIDE
from world import World, make

PARTS = {
    "scale_warms_up": ("scale", "the scale factor follows"),
    "axes_warm_up": ("axes", "the directions of the axes follow"),
    "axes_bend_with_heat": ("axes", "the directions of the axes follow"),
    "cubic_with_heat": ("transfer", "the transfer curve follows"),
    "fixture_bends": ("axes", "the directions of the axes follow"),
}


def command(*words: object) -> tuple[int, str]:
    """The command line in this process: status and standard output."""
    return given(*words, columns=120)[:2]


def test_every_such_physics_is_here() -> None:
    assert set(PARTS) == set(OUTSIDE)


FAST = ("scale_warms_up", "cubic_with_heat", "fixture_bends")
"""One physics of each part."""


@pytest.mark.usefixtures("no_next_measurement")
@pytest.mark.parametrize("name", [pytest.param(one, marks=[] if one in FAST else [pytest.mark.slow]) for one in PARTS])
def test_the_suggested_formula_explains_what_no_effect_does(tmp_path: Path, name: str) -> None:
    made = make(World(hidden=((name, 3.0),)), 6_400_002)
    for kind in ("dwells", "history", "fresh", "fresh_history"):
        getattr(made, kind).to_parquet(tmp_path / f"{kind}.parquet")
    data = (tmp_path / "dwells.parquet", "--history", tmp_path / "history.parquet")
    status, out = command("diagnose", *data, "--json")
    document = json.loads(out)
    part, text = PARTS[name]
    assert status == 1
    assert document["recommended"] == []
    assert document["unexplained"]["part"] == part
    assert document["unexplained"]["text"].startswith(text)
    status, out = command("diagnose", *data)
    assert " ".join(document["unexplained"]["text"].split()) in " ".join(out.split())
    offer = document["offer"]
    effects = ",".join(document["effects"])
    formula = ("--formula", f"{offer['id']}={'; '.join(offer['columns'])}")
    fresh = ("--fresh", tmp_path / "fresh.parquet", "--fresh-history", tmp_path / "fresh_history.parquet")
    before = json.loads(command("compare", *data, *fresh, "--effects", effects, "--json")[1])
    with_it = ("--effects", f"{effects},{offer['id']}", *formula)
    after = json.loads(command("compare", *data, *fresh, *with_it, "--json")[1])
    assert before["rms_ug"] > 2.5 * made.floor_ug
    assert after["rms_ug"] < 1.1 * made.floor_ug
    # the day of the fresh run wanders, too
    assert after["fresh_rms_ug"] < 0.6 * before["fresh_rms_ug"]
