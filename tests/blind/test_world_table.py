"""Every row of the world table gets its verdict."""

from types import SimpleNamespace

import pytest
from made_worlds import NOISES, World
from world_row import MadeLot, Row, made
from world_table import OWN_NOISE, POSES, rows

from pipelines.diagnosis.diagnose import diagnose

ROWS = list(rows())


@pytest.fixture(autouse=True)
def no_proposals(monkeypatch: pytest.MonkeyPatch) -> None:
    """Verdicts alone: proposed measurements are most of the time, and other slow suites make them."""
    monkeypatch.setattr("pipelines.diagnosis.diagnose.proposed", lambda _: SimpleNamespace(rows=list))


def told_in(group: dict, names: tuple[str, ...], units: tuple[str, ...], dwells: tuple[int, ...], how: str) -> bool:
    if how == "names":
        return bool(set(names) & set(group["effects"]))
    if not set(names) & set(group["effects"]) or tuple(group["units"]) != units:
        return False
    near = how != "near" or abs(group["dwells"][0] - dwells[0]) <= 1
    return near and (how != "dwells" or tuple(group["dwells"]) == dwells)


def wrong(row: Row, lot: MadeLot, document: dict) -> list[str]:
    """What a document says that the row does not allow."""
    groups, unexplained = document["classes"], document["unexplained"]
    names = [group["effects"] for group in groups]
    checks = {
        "first": row.first is None or sorted(group[0] for group in names) == sorted(row.first),
        "alone": not row.alone or all(len(group) == 1 for group in names),
        "named": all(any(name in group for group in names) for name in row.named),
        "told": not row.told
        or all(any(told_in(g, f.names, f.units, f.dwells, row.told) for g in groups) for f in lot.faults),
        "physics": row.physics or all(group["scope"] == "data" for group in groups),
        "adequate": document["adequate"] in row.adequate,
        "recommended": row.recommended is None or document["recommended"] == list(row.recommended),
        "blocked": not row.blocked or {fault["fault"] for fault in document["blocked_by"]} == set(row.blocked),
        "unexplained": row.unexplained is None
        or (unexplained["driver"] in row.unexplained if unexplained else not row.unexplained),
    }
    told = [what for what, holds in checks.items() if not holds]
    return told or ([row.also.__name__] if row.also and not row.also(document, lot) else [])


def marks(row: Row) -> list[pytest.MarkDecorator]:
    slow = [] if row.fast else [pytest.mark.slow]
    return slow + ([pytest.mark.xfail(strict=True, reason=row.not_reached)] if row.not_reached else [])


@pytest.mark.parametrize("row", [pytest.param(r, id=str(r), marks=marks(r)) for r in ROWS])
def test_a_world_gets_its_verdict(row: Row) -> None:
    lot = made(row.world, row.seed)
    document = diagnose(row.change(lot.dwells.copy()) if row.change else lot.dwells, lot.history)
    assert wrong(row, lot, document) == [], (lot.faults, document["classes"], document["unexplained"])


@pytest.mark.slow
def test_noise_that_grows_with_temperature_is_no_physics() -> None:
    # what is slower than a soak does not grow with it: of lots whose fast noise grows fourfold, one of sixteen is misjudged
    names = ("hot_x2", "hot_x4", "hot_x4_one_unit", "hot_white_x4")
    lots = [made(NOISES[name], OWN_NOISE + 40 + seed) for name in names for seed in range(3)]
    classes = [diagnose(lot.dwells, lot.history)["classes"] for lot in lots]
    assert sum(any(group["scope"] != "data" for group in groups) for groups in classes) <= 1


@pytest.mark.slow
def test_an_adequate_model_stays_adequate() -> None:
    lots = [made(World(), POSES + seed) for seed in range(10, 16)]
    documents = [diagnose(lot.dwells, lot.history) for lot in lots]
    assert [document["adequate"] for document in documents].count(True) >= 5
    assert all(document["classes"] == [] for document in documents)
