"""The rules of a line's schedule written a second time: what a schedule breaks, and the shortest one by trying every order."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

from pipelines.planning.line_lots import Phase
from pipelines.planning.line_schedule import STEP_S, Placed
from schemas.line import Line

DAY = 24 * 60 * 60 / STEP_S


class Task(NamedTuple):
    """Something that goes on: what is taken meanwhile, by whom, from when and for how many steps."""

    lot: int
    what: str
    takes: tuple[str, ...]
    begin: int
    length: int


def steps_of(minutes: float) -> int:
    return -int(-round(60.0 * minutes, 3) // STEP_S)


def changes(line: Line, phases: Sequence[Phase]) -> list[tuple[set[str], set[str], int]]:
    """Of each phase: shared resources, those that are new, steps of the change before it."""
    uses = [{one.name for one in line.shared if set(one.needed_for) & phase.needs} for phase in phases]
    supplies = {one.name for one in line.shared if set(one.needed_for) == {"soak"}}
    found = []
    for k, of_phase in enumerate(uses):
        new = of_phase - uses[k - 1] if k else of_phase
        if len(line.fixtures) == 1:
            new = of_phase - supplies
            turn = [*uses[k + 1 :], *uses[: k + 1]] if new else []
            others = [other - supplies for other in (turn[-2::-1] + turn[-1:]) if other - supplies]
            new = new - others[0] if others else new
        length = max((steps_of(one.change_min) for one in line.shared if one.name in new), default=0)
        found.append((of_phase, new, length))
    return found


def by_hand(line: Line, new: set[str]) -> bool:
    return any(one.by_hand and one.change_min > 0.0 and one.name in new for one in line.shared)


def tasks_of(line: Line, number: int, placed: Placed, phases: Sequence[Phase]) -> list[Task]:
    load, unload = steps_of(line.load_min), steps_of(line.unload_min)
    made = [Task(number, "load", ("operator",), placed.load, load)]
    before, end = set[str](), placed.load + load
    for (uses, new, change), phase, begin in zip(changes(line, phases), phases, placed.begins, strict=True):
        if uses & before:
            made.append(Task(number, "hold", tuple(sorted(uses & before)), end, begin - end))
        if change:
            hands = ("operator",) if by_hand(line, new) else ()
            made.append(Task(number, "change", (*sorted(new), *hands), begin - change, change))
        made.append(Task(number, phase.kind, tuple(sorted(uses)), begin, steps_of(phase.seconds / 60.0)))
        before, end = uses, made[-1].begin + made[-1].length
    made.append(Task(number, "unload", ("operator",), placed.unload, unload))
    return [*made, Task(number, "seat", ("fixture",), placed.load, placed.unload + unload - placed.load)]


def broken(line: Line, lots: Sequence[Sequence[Phase]], placed: Sequence[Placed]) -> list[str]:
    """Every rule that a schedule breaks, in words; empty for a schedule that can be carried out."""
    tasks = [
        task
        for k, (own, phases) in enumerate(zip(placed, lots, strict=True))
        for task in tasks_of(line, k, own, phases)
    ]
    counts = {one.name: one.count for one in line.shared}
    counts |= {"operator": line.operators.count, "fixture": len(line.fixtures)}
    out: list[str] = []
    for name, count in counts.items():
        edges = sorted(
            edge
            for task in tasks
            if name in task.takes and task.length
            for edge in ((task.begin, 1), (task.begin + task.length, -1))
        )
        level = 0
        for when, change in edges:
            level += change
            if level > count:
                out.append(f"{name}: {level} at {when}")
    for task in tasks:
        if "operator" in task.takes and line.operators.shifts:
            begin = line.start * 60.0 / STEP_S + task.begin
            spans = [(first * 60.0 / STEP_S, last * 60.0 / STEP_S) for first, last in line.operators.shifts]
            days = range(-1, int(begin // DAY) + 1)
            inside = any(a + DAY * d <= begin and begin + task.length <= b + DAY * d for a, b in spans for d in days)
            out += [] if inside else [f"{task.what} of {task.lot} at {task.begin} in no shift"]
    for k, phases in enumerate(lots):
        out += _broken_in_a_lot(line, k, phases, placed[k])
    return out


def _broken_in_a_lot(line: Line, number: int, phases: Sequence[Phase], own: Placed) -> list[str]:
    out: list[str] = []
    ends = [begin + steps_of(phase.seconds / 60.0) for begin, phase in zip(own.begins, phases, strict=True)]
    loaded = own.load + steps_of(line.load_min)
    out += [f"{number}: begins before it is loaded"] if own.begins[0] < loaded else []
    out += [f"{number}: is unloaded before its end"] if own.unload < ends[-1] else []
    of_phases = changes(line, phases)
    for k, (begin, end) in enumerate(zip(own.begins[1:], ends, strict=False), start=1):
        gap = begin - end
        same = of_phases[k][0] & of_phases[k - 1][0] and not of_phases[k][1]
        most = 0 if same or phases[k].kind == "return" else line.longest_wait_min * 60.0 / STEP_S + of_phases[k][2]
        out += [] if 0 <= gap <= most else [f"{number}: waits {gap} steps before phase {k}"]
    for k, (_, _, change) in enumerate(of_phases):
        moved = own.begins[k] - change
        at_rest = max([loaded, *(end for end, phase in zip(ends[:k], phases, strict=False) if phase.kind != "soak")])
        out += [f"{number}: is changed in a measurement"] if change and moved < at_rest else []
    return out


Order = tuple[int, int, int]  # variable, a later variable, and the fewest steps between


class Trial:
    """The shortest schedule by trying both orders of every two things that meet.

    With the orders decided the earliest times are the least for everything at once, so nothing better is missed. For resources
    that there is one of, as many fixtures as lots or one, and no shifts.
    """

    def __init__(self, line: Line, lots: Sequence[Sequence[Phase]]) -> None:
        self.line, self.lots = line, lots
        self.first = [sum(len(phases) + 2 for phases in lots[:k]) for k in range(len(lots))]  # the loading of each lot
        self.size = sum(len(phases) + 2 for phases in lots)
        self.best: int | None = None

    def steps(self) -> int | None:
        """Steps of the shortest schedule; None: there is none."""
        self._search([order for k in range(len(self.lots)) for order in self._of_lot(k)])
        return self.best

    def _of_lot(self, k: int) -> list[Order]:
        """The orders within a lot; its variables are its loading, its phases and its unloading."""
        phases, at, of_phases = self.lots[k], self.first[k], changes(self.line, self.lots[k])
        lengths = [steps_of(self.line.load_min), *(steps_of(p.seconds / 60.0) for p in phases)]
        orders = [(at + j, at + j + 1, length) for j, length in enumerate(lengths)]
        for j, (uses, _, change) in enumerate(of_phases):
            rests = [0, *(i + 1 for i in range(j) if phases[i].kind != "soak")]
            orders += [(at + i, at + j + 1, lengths[i] + change) for i in rests if change]
            if j:
                same = uses & of_phases[j - 1][0] and not of_phases[j][1]
                most = int(self.line.longest_wait_min * 60.0 // STEP_S) + change
                orders.append((at + j + 1, at + j, -lengths[j] - (0 if same or phases[j].kind == "return" else most)))
        return orders

    def _search(self, orders: list[Order]) -> None:
        times = self._earliest(orders)
        if times is None:
            return
        ends = [
            times[at + len(p) + 1] + steps_of(self.line.unload_min) for at, p in zip(self.first, self.lots, strict=True)
        ]
        if self.best is not None and max(ends) >= self.best:
            return
        met = self._met(times)
        if met is None:
            self.best = max(ends)
            return
        for (a, variable, offset), (_, other, before) in (met, met[::-1]):
            if a.what == "seat":  # its end hangs on the unloading
                last = self.first[a.lot] + len(self.lots[a.lot]) + 1
                self._search([*orders, (last, other, steps_of(self.line.unload_min) - before)])
            elif a.what == "hold":  # and of this on the begin of the next phase
                self._search([*orders, (variable + 1, other, -before)])
            else:
                self._search([*orders, (variable, other, offset + a.length - before)])

    def _earliest(self, orders: Sequence[Order]) -> list[int] | None:
        """The least times that keep the orders; None where they go round in a circle."""
        times = [0] * self.size
        for _ in range(self.size + 1):
            late = [
                (second, times[first] + steps)
                for first, second, steps in orders
                if times[second] < times[first] + steps
            ]
            if not late:
                return times
            for second, when in late:
                times[second] = max(times[second], when)
        return None

    def _met(self, times: Sequence[int]) -> tuple[tuple[Task, int, int], tuple[Task, int, int]] | None:
        """Two tasks of different lots that need the same thing at once, each with its variable and its begin after it."""
        held = [one for k in range(len(self.lots)) for one in self._held(k, times)]
        free = {"fixture"} if len(self.line.fixtures) > 1 else set[str]()
        for one, other in combinations(held, 2):
            a, b = one[0], other[0]
            over = a.begin < b.begin + b.length and b.begin < a.begin + a.length
            if a.lot != b.lot and over and (set(a.takes) & set(b.takes)) - free:
                return one, other
        return None

    def _held(self, k: int, times: Sequence[int]) -> list[tuple[Task, int, int]]:
        at, count = self.first[k], len(self.lots[k])
        placed = Placed(times[at], tuple(times[at + 1 : at + 1 + count]), times[at + count + 1])
        variable = {"load": at, "seat": at, "unload": at + count + 1}
        out: list[tuple[Task, int, int]] = []
        place = at + 1
        for task in tasks_of(self.line, k, placed, self.lots[k]):
            own = variable.get(task.what, place - (task.what == "hold"))
            out.append((task, own, task.begin - times[own]))
            place += task.what not in {*variable, "change", "hold"}
        return out
