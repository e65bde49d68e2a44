"""Schedules of lines: every rule is kept, none is shorter, and the durations are those of the plan."""

import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st
from line_rules import Trial, broken

from pipelines.jobs.recipes import load_recipe
from pipelines.planning import line_schedule
from pipelines.planning.line_document import free_places, plan_line
from pipelines.planning.line_lots import Phase, phases_of
from pipelines.planning.line_schedule import NoSchedule, shortest
from pipelines.schedule.steps import steps
from pipelines.schedule.timing import minutes
from schemas.errors import RecipeInvalid
from schemas.line import Line, staffed
from schemas.station import load_station

NEEDS = {one: {one} for one in ("soak", "measure", "static", "exciter")} | {"ramp": {"measure", "soak"}}


def phase(kind: str, steps_long: int) -> Phase:
    return Phase(kind, 25.0, 10.0 * steps_long, frozenset(NEEDS[kind]))


def line_of(fixtures: int, lots: int, **keys: object) -> Line:
    own = {"name": "drawn", "fixtures": [f"F{k}" for k in range(fixtures)], "lots": [{"recipe": "any", "count": lots}]}
    return Line.model_validate({**own, "load_min": 0.5, "unload_min": 0.5, **keys})


phases = st.lists(st.builds(phase, st.sampled_from(sorted(NEEDS)), st.integers(1, 9)), min_size=1, max_size=5)
tables = st.builds(
    lambda change, hand, more: {
        "name": "table", "needed_for": ["measure", *more], "change_min": change / 6.0, "by_hand": hand,
    },
    st.integers(0, 4), st.booleans(), st.lists(st.sampled_from(["static", "soak", "exciter"]), unique=True),
)  # fmt: skip
coolers = st.builds(lambda count: {"name": "cooler", "needed_for": ["soak"], "count": count}, st.integers(1, 2))
exciters = st.just({"name": "exciter", "needed_for": ["exciter"], "change_min": 0.5, "by_hand": True})
shared = st.lists(st.one_of(tables, coolers, exciters), max_size=3, unique_by=lambda one: one["name"])


@settings(max_examples=10, deadline=None)
@drawn(st.integers(1, 3), st.lists(phases, min_size=1, max_size=4), shared, st.integers(0, 12), st.integers(1, 2))
def test_a_schedule_keeps_every_rule(
    fixtures: int, lots: list[list[Phase]], shared: list, wait: int, people: int
) -> None:
    line = line_of(fixtures, len(lots), shared=shared, longest_wait_min=wait / 6.0, operators={"count": people})
    found = shortest(line, lots)
    assert broken(line, lots, found.lots) == []
    ends = [own.unload + 3 for own in found.lots]
    assert found.bound <= max(ends) <= found.makespan


@settings(max_examples=10, deadline=None)
@drawn(st.integers(1, 3), st.lists(phases, min_size=1, max_size=3), shared)
def test_work_by_hand_lies_in_shifts(fixtures: int, lots: list[list[Phase]], shared: list) -> None:
    shifts = {"shifts": ["08:00-08:05", "23:58-00:02"]}
    line = line_of(fixtures, len(lots), shared=shared, longest_wait_min=24 * 60, operators=shifts, start="07:59")
    assert broken(line, lots, shortest(line, lots).lots) == []


@settings(max_examples=25, deadline=None)
@drawn(
    st.sampled_from([1, 3]), st.lists(phases, min_size=1, max_size=3), st.lists(tables, max_size=1), st.integers(0, 6)
)
def test_no_order_is_shorter(fixtures: int, lots: list[list[Phase]], shared: list, wait: int) -> None:
    line = line_of(fixtures, len(lots), shared=shared, longest_wait_min=wait / 6.0)
    found = shortest(line, lots)
    assert found.bound == found.makespan == Trial(line, lots).steps()


@pytest.mark.parametrize("fixtures", [2, 3])
def test_a_chamber_that_is_the_table_keeps_its_lot_from_the_soak_to_the_measurement(fixtures: int) -> None:
    lots = [[phase("soak", 9), phase("measure", 3), phase("soak", 9), phase("measure", 3)]] * 3
    one = {"name": "table", "needed_for": ["soak", "measure"], "change_min": 0.5, "by_hand": True}
    line = line_of(fixtures, 3, shared=[one])
    found = shortest(line, lots)
    assert broken(line, lots, found.lots) == []
    for own in found.lots:
        assert [begin - own.begins[0] for begin in own.begins] == [0, 9, 12, 21]
    first, second, _ = (own.begins[0] for own in found.lots)
    assert second - first == 24 + 3


def test_what_is_kept_is_held_while_another_resource_comes() -> None:
    vibrated = Phase("measure", 25.0, 60.0, frozenset({"measure", "exciter"}))
    lots = [[phase("measure", 6), vibrated]] * 2
    keys = {"change_min": 0.5, "by_hand": True}
    shared = [
        {"name": name, "needed_for": [need], **keys} for name, need in (("table", "measure"), ("shaker", "exciter"))
    ]
    line = line_of(2, 2, shared=shared)
    found = shortest(line, lots)
    assert broken(line, lots, found.lots) == []
    assert [own.begins[1] - own.begins[0] for own in found.lots] == [6 + 3] * 2
    assert found.bound == found.makespan == Trial(line, lots).steps()


def test_the_phases_of_a_recipe_take_as_long_as_its_plan_says() -> None:
    station = load_station()
    for name in ("production", "quick"):
        recipe = load_recipe(name)
        own = [one for one in phases_of(recipe, station) if one.kind != "return"]
        assert sum(one.seconds for one in own) / 60.0 == pytest.approx(minutes(steps(recipe), station, recipe).total)
    kinds = [one.kind for one in phases_of(load_recipe("quick"), station)]
    assert kinds == ["ramp", "soak", "static", "return"]


def test_two_fixtures_hide_the_soaks_of_each_other() -> None:
    line = line_of(2, 4, shared=[{"name": "table", "needed_for": ["measure", "static"]}], load_min=6, unload_min=4)
    found = plan_line(line, load_station(), lambda name: load_recipe("production"))
    alone = found["one_after_another"]["makespan_min"]
    assert found["proven"]
    assert found["bound_min"] == found["makespan_min"] < 0.6 * alone
    assert {lot["fixture"] for lot in found["lots"]} == {"F0", "F1"}
    assert found["resources"][0]["resource"] == "fixtures"
    assert alone == pytest.approx(4 * found["resources"][0]["minutes_per_lot"], abs=0.01)


def test_one_lot_after_the_other_is_the_schedule_where_changes_take_longer_than_they_save() -> None:
    table = {"name": "table", "needed_for": ["measure", "static"], "change_min": 40, "by_hand": True}
    line = line_of(2, 4, shared=[table], load_min=6, unload_min=4)
    found = plan_line(line, load_station(), lambda name: load_recipe("quick"))
    assert found["makespan_min"] == found["one_after_another"]["makespan_min"] == found["bound_min"]
    assert found["proven"]
    assert {lot["fixture"] for lot in found["lots"]} == {"F0"}
    assert "change" not in {one["activity"] for one in found["activities"]}
    assert max(lot["unloaded_min"] for lot in found["lots"]) == pytest.approx(found["makespan_min"])


def test_one_lot_after_the_other_is_the_schedule_where_no_shift_has_time_for_a_change() -> None:
    """The shift is long enough to load and to unload, a day apart, and ends before the soak that the change follows."""
    table = {"name": "table", "needed_for": ["measure", "static"], "change_min": 5, "by_hand": True}
    keys = {"shared": [table], "operators": {"shifts": ["06:00-06:12"]}, "start": "06:00", "longest_wait_min": 1}
    line = line_of(2, 2, load_min=6, unload_min=4, **keys)
    with pytest.raises(NoSchedule):
        shortest(line, [phases_of(load_recipe("production"), load_station())] * 2)
    found = plan_line(line, load_station(), lambda name: load_recipe("production"))
    assert found["makespan_min"] == found["one_after_another"]["makespan_min"]
    assert found["proven"]
    assert "change" not in {one["activity"] for one in found["activities"]}


@pytest.mark.parametrize(
    ("shifts", "part"),
    [
        ([], 1.0),
        (["06:00-14:00"], 8 / 24),
        (["08:00-16:00", "06:00-14:00"], 10 / 24),
        (["22:00-06:00", "05:00-07:00"], 9 / 24),
        (["00:00-24:00", "06:00-14:00"], 1.0),
    ],
)
def test_shifts_that_overlap_count_once(shifts: list[str], part: float) -> None:
    line = line_of(1, 1, operators={"shifts": shifts})
    assert staffed(line.operators.shifts) == pytest.approx(part)
    found = plan_line(line, load_station(), lambda name: load_recipe("quick"))
    row = next(row for row in found["resources"] if row["resource"] == "operator")
    assert row["bound_per_lot_min"] == pytest.approx(row["minutes_per_lot"] / part)


def test_a_line_without_a_schedule_is_refused_and_a_search_that_ends_does_not_say_that_there_is_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lots = [[phase("measure", 6), phase("exciter", 5000), phase("measure", 6)]]
    shared = [{"name": name, "needed_for": [name], "change_min": 2, "by_hand": True} for name in ("measure", "exciter")]
    line = line_of(2, 1, longest_wait_min=1, operators={"shifts": ["06:00-06:10"]}, start="06:00", shared=shared)
    with pytest.raises(RecipeInvalid, match=r"longest_wait_min 1 .* lengthen a shift"):
        shortest(line, lots)
    monkeypatch.setattr(line_schedule, "WORK", 0.0)
    lots = [[phase("soak", 6), phase("measure", 6)]] * 4
    table = [{"name": "table", "needed_for": ["measure"], "change_min": 0.5, "by_hand": True}]
    with pytest.raises(RecipeInvalid, match="the search found no schedule of 4 lots"):
        shortest(line_of(2, 4, shared=table), lots)


def test_places_are_taken_as_they_become_free() -> None:
    assert free_places([(0, 5), (1, 3), (3, 9), (5, 6), (2, 4)]) == [0, 1, 1, 0, 2]
