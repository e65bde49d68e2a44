"""Every row of the world table gets its verdict."""

import pytest
from truth import case
from world_row import Blind, Case, Row, World
from world_table import NOISES, OWN_NOISE, POSES, rows

from pipelines.diagnosis.diagnose import diagnose

# found by way of the table
from continued_run import Continued  # isort: skip
from world import Made, make  # isort: skip

pytestmark = pytest.mark.usefixtures("no_next_measurement")
ROWS = list(rows())


def made_and_said(row: Row) -> tuple[Made | None, dict]:
    if isinstance(row.world, Blind):
        return None, diagnose(*Continued(row.world, row.seed).tables())
    if isinstance(row.world, Case):
        run = case(row.world.scenario, row.world.index, row.seed)
        return None, diagnose(run.dwells, run.history if run.sealed.spec.history else None)
    made = make(row.world, row.seed)
    return made, diagnose(row.change(made.dwells.copy()) if row.change else made.dwells, made.history)


def told_in(group: dict, names: tuple[str, ...], units: tuple[str, ...], dwells: tuple[int, ...], how: str) -> bool:
    """Whether a class tells a fault, as exactly as the row asks."""
    if how == "names":
        return bool(set(names) & set(group["effects"]))
    if not set(names) & set(group["effects"]) or tuple(group["units"]) != units:
        return False
    near = how != "near" or abs(group["dwells"][0] - dwells[0]) <= 1
    return near and (how != "dwells" or tuple(group["dwells"]) == dwells)


def wrong(row: Row, made: Made | None, document: dict) -> list[str]:
    """What a document says that the row does not allow."""
    groups, unexplained = document["classes"], document["unexplained"]
    names, faults = [group["effects"] for group in groups], made.faults if made else ()
    checks = {
        "first": row.first is None or sorted(group[0] for group in names) == sorted(row.first),
        "alone": not row.alone or all(len(group) == 1 for group in names),
        "named": all(any(name in group for group in names) for name in row.named),
        "told": not row.told
        or all(any(told_in(g, f.names, f.units, f.dwells, row.told) for g in groups) for f in faults),
        "physics": row.physics or all(group["scope"] == "data" for group in groups),
        "adequate": document["adequate"] in row.adequate,
        "recommended": row.recommended is None or document["recommended"] == list(row.recommended),
        "blocked": not row.blocked or {fault["fault"] for fault in document["blocked_by"]} == set(row.blocked),
        "unexplained": row.unexplained is None
        or (unexplained["driver"] in row.unexplained if unexplained else not row.unexplained),
    }
    told = [what for what, holds in checks.items() if not holds]
    return told or ([row.also.__name__] if row.also and made and not row.also(document, made) else [])


@pytest.mark.parametrize("row", [pytest.param(r, id=str(r), marks=() if r.fast else pytest.mark.slow) for r in ROWS])
def test_a_world_gets_its_verdict(row: Row) -> None:
    made, document = made_and_said(row)
    assert wrong(row, made, document) == [], (made and made.faults, document["classes"], document["unexplained"])


def test_sixteen_rows_are_part_of_every_run() -> None:
    assert sum(row.fast for row in ROWS) == 16


@pytest.mark.slow
def test_noise_that_grows_with_temperature_is_no_physics() -> None:
    # what is slower than a soak does not grow with it: of lots whose fast noise grows fourfold, one of sixteen is misjudged
    names = ("hot_x2", "hot_x4", "hot_x4_one_unit", "hot_white_x4")
    made = [make(NOISES[name], OWN_NOISE + 40 + seed) for name in names for seed in range(3)]
    classes = [diagnose(one.dwells, one.history)["classes"] for one in made]
    assert sum(any(group["scope"] != "data" for group in groups) for groups in classes) <= 1


@pytest.mark.slow
def test_an_adequate_model_stays_adequate() -> None:
    made = [make(World(), POSES + seed) for seed in range(10, 16)]
    documents = [diagnose(one.dwells, one.history) for one in made]
    assert [d["adequate"] for d in documents].count(True) >= 5
    assert all(d["classes"] == [] for d in documents)
