"""The shortest schedule of lots over the fixtures of a line, and a proof of how short it can be, by CP-SAT of OR-tools.

A lot is loaded, goes through its phases in one fixture, and is unloaded. What holds:

- a phase is not interrupted, and the shared resources that it needs are held from its begin to its end;
- between two phases a lot waits at its temperature, ``longest_wait_min`` and a change at most; loaded or done it waits at will;
- successive phases that need the same shared resource are one stay on it: it is held between them, too, and they follow each
  other at once unless another resource comes in between;
- each stay begins with a change, during which the lot is not measured; one fixture stays where it is between equal stays;
- loading, unloading and changes by hand take one operator each, within one shift.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from pipelines.planning.line_lots import Phase
from schemas.bounds import DAY_S
from schemas.errors import RecipeInvalid
from schemas.library import library
from schemas.line import Line, Shared

STEP_S = 10.0
"""Of the times of a schedule: every duration is rounded up to it."""
WORK = 10.0
"""Of the search for the shortest schedule, in the solver's own measure: one is of the order of a second."""
TIDYING = 1.0
"""Of the search for the one with the shortest waits among those."""
LONGEST_DAYS = 14  # for each lot: a line with shifts too short for its lots is refused
_DAY = round(DAY_S / STEP_S)


class NoSchedule(RecipeInvalid):
    """No schedule keeps every rule."""


@dataclass(frozen=True)
class Stay:
    """Names of the shared resources that a phase holds, of those held since the phase before, and of the new.

    change : steps of the change before it; by_hand : whether that takes an operator
    """

    resources: tuple[str, ...]
    held: tuple[str, ...]
    changed: tuple[str, ...]
    change: int
    by_hand: bool


@dataclass(frozen=True)
class Placed:
    """A lot in a schedule, in steps: begin of its loading, of each phase, and of its unloading."""

    load: int
    begins: tuple[int, ...]
    unload: int


@dataclass(frozen=True)
class Shortest:
    """The lots in the order given, the steps until the last lot is unloaded, and the bound below which no schedule is."""

    lots: list[Placed]
    makespan: int
    bound: int
    solver: str


def step_count(seconds: float) -> int:
    """Steps of a duration, rounded up."""
    return -int(-round(seconds, 3) // STEP_S)


def stays(line: Line, phases: Sequence[Phase]) -> list[Stay]:
    """The shared resources that each phase of a lot holds, and the changes before it."""
    needed = [
        [resource for resource in line.shared if phase.needs.intersection(resource.needed_for)] for phase in phases
    ]
    # a supply for soaks alone reaches a single fixture wherever it is
    places = [[resource for resource in of_phase if set(resource.needed_for) != {"soak"}] for of_phase in needed]
    users = [k for k, of_phase in enumerate(places) if of_phase]
    made: list[Stay] = []
    for k, resources in enumerate(needed):
        held = [resource for resource in resources if k and resource in needed[k - 1]]
        new = [resource for resource in resources if resource not in held]
        if len(line.fixtures) == 1:  # it stays where it is, and each lot ends on what the next begins on
            there = places[users[users.index(k) - 1]] if k in users else []
            new = [resource for resource in places[k] if resource not in there]
        change = max((step_count(60.0 * resource.change_min) for resource in new), default=0)
        by_hand = any(resource.by_hand and resource.change_min for resource in new)
        made.append(Stay(_names(resources), _names(held), _names(new), change, by_hand))
    return made


def _names(resources: Sequence[Shared]) -> tuple[str, ...]:
    return tuple(resource.name for resource in resources)


def shortest(line: Line, lots: Sequence[Sequence[Phase]]) -> Shortest:
    """The shortest schedule of lots, each given by its phases.

    Raises
    ------
    WrongUse
        OR-tools is not installed.
    NoSchedule
        There is none within two weeks for each lot.
    RecipeInvalid
        The search finds none in its time.
    """
    cp = library("ortools.sat.python.cp_model", "schedule", f"line {line.name}: the shortest schedule")
    model = _Model(cp, line, lots)
    solver = cp.CpSolver()
    # one thread, and work counted instead of seconds: the schedule does not depend on the machine
    solver.parameters.num_workers, solver.parameters.linearization_level, solver.parameters.random_seed = 1, 2, 1
    solver.parameters.max_deterministic_time = WORK
    model.cp.minimize(model.makespan)
    status = solver.solve(model.cp)
    if status == cp.INFEASIBLE:
        raise NoSchedule(
            f"line {line.name}: no schedule keeps longest_wait_min {line.longest_wait_min:g} with these shifts; lengthen a shift "
            "or the wait, or let the change of a shared resource be automatic"
        )
    if status not in {cp.OPTIMAL, cp.FEASIBLE}:
        raise RecipeInvalid(
            f"line {line.name}: the search found no schedule of {len(lots)} lots in its time; plan fewer lots at once"
        )
    makespan = round(solver.objective_value)
    bound = min(round(solver.best_objective_bound), makespan)
    for variable in model.variables:
        model.cp.add_hint(variable, solver.value(variable))
    model.cp.add(model.makespan <= makespan)
    model.cp.minimize(sum(2 * placed[2] - placed[0] for placed in model.placed))
    solver.parameters.max_deterministic_time = TIDYING
    tidy = cp.CpSolver()
    tidy.parameters.copy_from(solver.parameters)
    found = tidy if tidy.solve(model.cp) in {cp.OPTIMAL, cp.FEASIBLE} else solver
    placed = [
        Placed(found.value(load), tuple(found.value(begin) for begin in begins), found.value(unload))
        for load, begins, unload in model.placed
    ]
    return Shortest(placed, makespan, bound, f"CP-SAT {library('ortools', 'schedule', line.name).__version__}")


class _Model:
    """The constraints of a line as a model of CP-SAT."""

    def __init__(self, cp: Any, line: Line, lots: Sequence[Sequence[Phase]]) -> None:
        self.cp, self.line, self._domain = cp.CpModel(), line, cp.Domain
        self.load, self.unload = step_count(60.0 * line.load_min), step_count(60.0 * line.unload_min)
        self.wait = int(60.0 * line.longest_wait_min // STEP_S)
        self.horizon = LONGEST_DAYS * _DAY * len(lots) if line.operators.shifts else self._one_by_one(lots)
        self.variables: list[Any] = []
        self.held: dict[str, list[Any]] = {resource.name: [] for resource in line.shared}
        self.hands: list[Any] = []
        self.fixtures: list[Any] = []
        self.placed = [self._lot(phases) for phases in lots]
        self.makespan = self._time()
        for _, _, unload in self.placed:
            self.cp.add(self.makespan >= unload + self.unload)
        for resource in line.shared:
            self._at_most(self.held[resource.name], resource.count)
        self._at_most(self.hands, line.operators.count)
        self._at_most(self.fixtures, len(line.fixtures))
        self._in_order(lots)

    def _one_by_one(self, lots: Sequence[Sequence[Phase]]) -> int:
        """Steps in which the lots are done in sequence, with every change."""
        return sum(
            self.load
            + self.unload
            + sum(step_count(p.seconds) for p in phases)
            + sum(s.change for s in stays(self.line, phases))
            for phases in lots
        )

    def _time(self, by_hand: int = 0) -> Any:
        """A time; where an operator works for ``by_hand`` steps from then on, within a shift."""
        shifts = self.line.operators.shifts
        if not by_hand or not shifts:
            made = self.cp.new_int_var(0, self.horizon, "")
        else:
            start = step_count(60.0 * self.line.start)
            spans = [
                [
                    max(0, step_count(60.0 * begin) - start + _DAY * day),
                    int(60.0 * end // STEP_S) - start + _DAY * day - by_hand,
                ]
                for day in range(-2, self.horizon // _DAY + 1)
                for begin, end in shifts
            ]
            made = self.cp.new_int_var_from_domain(
                self._domain.from_intervals([span for span in spans if span[0] <= span[1]]), ""
            )
        self.variables.append(made)
        return made

    def _lot(self, phases: Sequence[Phase]) -> tuple[Any, list[Any], Any]:
        """Begin of loading, of each phase and of unloading of a lot."""
        load = self._time(self.load)
        self.hands.append(self.cp.new_fixed_size_interval_var(load, self.load, ""))
        end = free = load + self.load  # end of the phase before; of the last phase in which the lot cannot be moved
        begins: list[Any] = []
        for phase, stay in zip(phases, stays(self.line, phases), strict=True):
            length, begin = step_count(phase.seconds), self._time()
            self.cp.add(begin >= end)
            if phase.kind == "return" or (stay.held and not stay.changed):
                self.cp.add(begin == end)
            elif begins:
                self.cp.add(begin <= end + self.wait + stay.change)
                for name in stay.held:
                    between = self._time()
                    self.cp.add(between == begin - end)
                    self.held[name].append(self.cp.new_interval_var(end, between, begin, ""))
            if stay.change:
                change = self._time(stay.change if stay.by_hand else 0)
                self.cp.add(change + stay.change == begin)
                self.cp.add(change >= free)
                if stay.by_hand:
                    self.hands.append(self.cp.new_fixed_size_interval_var(change, stay.change, ""))
            for name in stay.resources:
                before = stay.change if name in stay.changed else 0
                self.held[name].append(self.cp.new_fixed_size_interval_var(begin - before, length + before, ""))
            begins.append(begin)
            end = begin + length
            free = free if phase.kind == "soak" else end
        unload = self._time(self.unload)
        self.cp.add(unload >= end)
        self.hands.append(self.cp.new_fixed_size_interval_var(unload, self.unload, ""))
        self.fixtures.append(self.cp.new_interval_var(load, self._time(), unload + self.unload, ""))
        return load, begins, unload

    def _at_most(self, intervals: Sequence[Any], count: int) -> None:
        """No more than ``count`` of these at a time."""
        if count == 1:
            self.cp.add_no_overlap(intervals)
        elif intervals:
            self.cp.add_cumulative(intervals, [1] * len(intervals), count)

    def _in_order(self, lots: Sequence[Sequence[Phase]]) -> None:
        """Equal lots go through every phase in the order given: two that overtake each other may change their names there."""
        equal: dict[tuple[Phase, ...], list[tuple[Any, list[Any], Any]]] = {}
        for phases, placed in zip(lots, self.placed, strict=True):
            equal.setdefault(tuple(phases), []).append(placed)
        for group in equal.values():
            for (a, earlier, b), (c, later, d) in pairwise(group):
                for first, second in zip((a, *earlier, b), (c, *later, d), strict=True):
                    self.cp.add(first <= second)
        if len(equal) == 1:
            apart = len(self.line.fixtures)
            for (_, _, unload), (load, _, _) in zip(self.placed, self.placed[apart:], strict=False):
                self.cp.add(load >= unload + self.unload)
