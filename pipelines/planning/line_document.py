"""The document of a line: its shortest schedule beside one lot after the other, and what bounds it."""

from collections.abc import Callable, Sequence
from itertools import count

from pipelines.planning.documents import LineActivity, LineDocument, LineLot, LineRate, LineResource
from pipelines.planning.line_lots import Phase, phases_of
from pipelines.planning.line_schedule import STEP_S, NoSchedule, Placed, Shortest, shortest, stays, step_count
from schemas.line import DAY_MIN, FIXTURES, OPERATOR, Line, staffed
from schemas.recipe import Recipe
from schemas.station import StationConfig

PER_MIN = 60.0 / STEP_S


def plan_line(line: Line, station: StationConfig, recipe_named: Callable[[str], Recipe]) -> LineDocument:
    """The schedule of a line's lots; see :func:`pipelines.planning.line_schedule.shortest` for what it keeps and raises.

    recipe_named : the recipe of a name in the line's file
    """
    recipes = [(recipe_named(lot.recipe), lot.count) for lot in line.lots]
    phases = [lot_phases for recipe, number in recipes for lot_phases in [phases_of(recipe, station)] * number]
    counters = {recipe.name: count(1) for recipe, _ in recipes}
    names = [recipe.name for recipe, number in recipes for _ in range(number)]
    used, best, alone, bound = _best(line, phases)
    spans = [(placed.load, placed.unload + step_count(60.0 * line.unload_min)) for placed in best.lots]
    fixtures = [line.fixtures[k] for k in free_places(spans)]
    labels = [f"{name}-{next(counters[name])}" for name in names]
    activities = [
        activity
        for label, fixture, placed, lot_phases in zip(labels, fixtures, best.lots, phases, strict=True)
        for activity in _activities(used, label, fixture, placed, lot_phases)
    ]
    resources = _resources(used, phases)
    return {
        "line": line.name,
        "station": station.name,
        "solver": best.solver,
        "start_min": line.start,
        **_rate(best),
        "bound_min": bound / PER_MIN,
        "proven": bound >= best.makespan,
        "one_after_another": _rate(alone),
        "lots": [
            _lot(label, name, fixture, [activity for activity in activities if activity["lot"] == label])
            for label, name, fixture in zip(labels, names, fixtures, strict=True)
        ],
        "resources": resources,
        "activities": sorted(
            activities, key=lambda activity: (activity["begin_min"], activity["end_min"], activity["lot"])
        ),
    }


def _best(line: Line, phases: Sequence[Sequence[Phase]]) -> tuple[Line, Shortest, Shortest, int]:
    """The line as it is used, its shortest schedule, that of one lot after the other in one fixture, and the bound of all.

    One fixture needs no changes: they may take longer than the soaks that they make use of, or find no place in the shifts.
    """
    if len(line.fixtures) == 1:
        alone = shortest(line, phases)
        return line, alone, alone, alone.bound
    single = line.model_copy(update={"fixtures": line.fixtures[:1]})
    try:
        best = shortest(line, phases)
    except NoSchedule as refused:
        try:
            alone = shortest(single, phases)
        except NoSchedule:
            raise refused from None
        return single, alone, alone, alone.bound
    alone = shortest(single, phases)
    if alone.makespan < best.makespan:
        return single, alone, alone, min(best.bound, alone.bound)
    return line, best, alone, best.bound


def free_places(spans: Sequence[tuple[int, int]]) -> list[int]:
    """Index, from 0, of the first fixture that is free at the begin of each (begin, end)."""
    until: list[int] = []
    places = [0] * len(spans)
    for number in sorted(range(len(spans)), key=lambda k: spans[k]):
        begin, end = spans[number]
        free = next((k for k, taken in enumerate(until) if taken <= begin), len(until))
        until[free : free + 1] = [end]
        places[number] = free
    return places


def _rate(found: Shortest) -> LineRate:
    minutes = found.makespan / PER_MIN
    each = minutes / len(found.lots)
    return {"makespan_min": minutes, "minutes_per_lot": each, "lots_per_day": DAY_MIN / each}


def _activities(line: Line, lot: str, fixture: str, placed: Placed, phases: Sequence[Phase]) -> list[LineActivity]:

    def activity(
        kind: str, begin: int, steps: int, resources: Sequence[str], temperature: float | None
    ) -> LineActivity:
        return {
            "lot": lot, "fixture": fixture, "activity": kind, "temperature_C": temperature,
            "begin_min": begin / PER_MIN, "end_min": (begin + steps) / PER_MIN, "resources": list(resources),
        }  # fmt: skip

    made = [activity("load", placed.load, step_count(60.0 * line.load_min), [OPERATOR], None)]
    for phase, stay, begin in zip(phases, stays(line, phases), placed.begins, strict=True):
        if stay.change:
            hands = [OPERATOR] if stay.by_hand else []
            made.append(activity("change", begin - stay.change, stay.change, [*stay.changed, *hands], None))
        made.append(activity(phase.kind, begin, step_count(phase.seconds), stay.resources, phase.temperature))
    return [*made, activity("unload", placed.unload, step_count(60.0 * line.unload_min), [OPERATOR], None)]


def _lot(lot: str, recipe: str, fixture: str, activities: Sequence[LineActivity]) -> LineLot:
    """A lot from loading to unloading; it waits where none of its phases goes on."""
    phases = [activity for activity in activities if activity["activity"] not in {"load", "change", "unload"}]
    first, last = phases[0]["begin_min"], phases[-1]["end_min"]
    return {
        "lot": lot, "recipe": recipe, "fixture": fixture,
        "loaded_min": activities[0]["begin_min"], "unloaded_min": activities[-1]["end_min"],
        "wait_min": last - first - sum(phase["end_min"] - phase["begin_min"] for phase in phases),
    }  # fmt: skip


def _resources(line: Line, lots: Sequence[Sequence[Phase]]) -> list[LineResource]:
    """The use of every counted resource by the lots, the highest use of a single item first.

    Of operators it is counted against the part of the day that has a shift.
    """
    held = dict.fromkeys((resource.name for resource in line.shared), 0.0)
    hands = fixtures = 0.0
    for phases in lots:
        by_hand = step_count(60.0 * line.load_min) + step_count(60.0 * line.unload_min)
        fixtures += by_hand
        for phase, stay in zip(phases, stays(line, phases), strict=True):
            fixtures += step_count(phase.seconds)
            by_hand += stay.change if stay.by_hand else 0
            for name in stay.resources:
                held[name] += step_count(phase.seconds) + (stay.change if name in stay.changed else 0)
        hands += by_hand
    needed = [(resource.name, resource.count, held[resource.name]) for resource in line.shared]
    day = staffed(line.operators.shifts)
    needed += [(FIXTURES, len(line.fixtures), fixtures), (OPERATOR, line.operators.count, hands)]
    rows: list[LineResource] = [
        {
            "resource": name,
            "count": number,
            "minutes_per_lot": steps / PER_MIN / len(lots),
            "bound_per_lot_min": steps / PER_MIN / len(lots) / number / (day if name == OPERATOR else 1.0),
        }
        for name, number, steps in needed
    ]
    return sorted(rows, key=lambda row: -row["bound_per_lot_min"])
