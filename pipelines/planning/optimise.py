"""The cheapest recipe that fulfils a wish: soaks, dwells at each, poses, their order, and the length of dwells."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from inertial import design
from inertial.errors import NotIdentified
from inertial.planning.pose_exchange import exchanged
from inertial.planning.visibility import sights
from pipelines.planning.dwell_counts import FEWEST, MOST, fewest_dwells
from pipelines.planning.layout import PlanDesign, TimedDesign, spanned
from pipelines.planning.lower_bound import least
from pipelines.planning.plan import identified, plan_context
from pipelines.planning.soak_orders import mirrored, orders
from pipelines.planning.textbook import PART_SEEN
from pipelines.planning.verification_poses import apart, numbered, turns
from pipelines.schedule.timing import spent
from schemas.errors import RecipeInvalid
from schemas.recipe import SoakPart

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from inertial.planning.expected import Expected
    from pipelines.planning.plan import PlanContext
    from pipelines.planning.requirement import Requirement
    from schemas.recipe import Recipe

    Array = NDArray[np.float64]
    Progress = Callable[[str], None]

TRIED = 3
"""Orders of soaks in which poses are exchanged."""

LIKELY = 12
"""Orders whose number of dwells is looked for, of those that two sizes of a plain design rank first."""

ROUNDS = 4
"""Exchanges per order: each tells how much better than a plain design an exchanged one is, and so how many dwells it needs."""

ROUGH = 1.2
"""What a plain design may lack and an exchange of poses is believed to mend, before there has been one."""

NEAR = 0.985
"""Part of what is wanted from which fewer dwells are not tried."""

SLOWER = 1.02
"""Station time over that of the best recipe so far from which a design is left alone."""

SPARE = 0.003
"""What is left between the errors wanted and those aimed at: counts are whole numbers."""


@dataclass(frozen=True)
class Optimum:
    """The recipe found, what it takes and expects, the one that it is held against, and what it lacks of the wish (≤ 1)."""

    planned: PlanContext
    expected: Expected
    against: PlanContext
    wish: Requirement
    worst: float

    @property
    def share(self) -> float:
        """Station time over that of the recipe that it is held against, without the static record."""
        return _busy(self.planned) / _busy(self.against)


def _busy(course: PlanContext) -> float:
    """Minutes of station time without the static record."""
    own = spent(course.stretches)
    return own.total - own.static_record


def optimise(
    recipe: Recipe, against: PlanContext, wish: Requirement, progress: Progress, *, lack: float = 1.0
) -> Optimum:
    """The cheapest recipe that was found to fulfil a wish.

    Parameters
    ----------
    lack : errors over those wanted up to which the nearest recipe is taken where none fulfils the wish, if it is quicker
        than the one that it is held against

    Orders of soaks are ranked by the station time that a plain design needs in them, every soak with the dwells it needs; in
    the best, poses are exchanged (:mod:`inertial.planning.pose_exchange`), and dwells are added or taken away until the
    requirement is just fulfilled.

    Raises
    ------
    RecipeInvalid
        No recipe that was tried fulfils it; the message says how near the best comes.
    """
    search = RecipeSearch(recipe, against, wish)
    best: PlanContext | None = None
    ranked = search.ranked()
    for number, (made, _) in enumerate(ranked, start=1):
        soaks = ", ".join(f"{t:g}" for t in made.order)
        progress(f"soaks at {soaks} °C ({number} of {len(ranked)})")
        best = search.best(made, best)
    best = best or search.nearest_within(lack)
    if best is None:
        raise RecipeInvalid(_refusal(search))
    return Optimum(best, identified(best), against, wish, float(np.max(search.reached(best))))


def _refusal(search: RecipeSearch) -> str:
    """Why there is no recipe, how near the nearest comes, and the least time that physics would allow."""
    wish, near = search.wish, search.nearest
    said = f"plan optimise: no recipe of up to {MOST} dwells "
    if search.unseen:
        return f"{said}sees {', '.join(search.unseen)}; ask for fewer effects (--see), or more temperatures (--temperatures)"
    if wish.parting is not None:
        chi = f"leaves χ² {wish.parting.wanted / near**2:.2g} where {wish.parting.wanted:g} is wanted"
        return f"{said}tells these effects apart; the nearest {chi}; give effects {near:.1f} times as large (--size)"
    found = least(search.recipe, search.against, wish)
    if found is None:
        why = "; even dwells without end do not reach them in the textbook plan's time: the device wanders more over a run"
    else:
        why = f"; even dwells without end take {100.0 * found.share:.0f} % of the textbook plan's time, for {found.effect}"
    nearest = f"; the nearest has {near:.3f} times those" if math.isfinite(near) else ""
    return f"{said}reaches the errors wanted{nearest}{why}; allow larger errors (--factor, --wanted), or other temperatures"


class RecipeSearch:
    """Designs for one recipe, station and wish."""

    def __init__(self, recipe: Recipe, against: PlanContext, wish: Requirement) -> None:
        self.recipe, self.against, self.wish = recipe, against, wish
        self.layout = TimedDesign(recipe, against.station, against.noise, wish, slowest=float(against.state.time[-1]))
        self.nearest = math.inf
        self.near: tuple[float, PlanContext] | None = None
        self.unseen: list[str] = []

    def ranked(self) -> list[tuple[PlanDesign, float]]:
        """Plain designs with the fewest dwells in promising orders of soaks, and their station time in s, the quickest first."""
        wish, recipe = self.wish, self.recipe
        back = wish.parting is None
        found = orders(wish.levels, self.against.station, recipe.soak_min_s, legal=wish.legal, back=back)
        dwell_s = self.layout.dwells()[0]
        likely = sorted((self.guessed(order, dwell_s), order) for order in found)[:LIKELY]
        tried: list[tuple[float, PlanDesign]] = []
        for seconds, order in likely:
            if math.isfinite(seconds):
                tried += [self.plain(PlanDesign(order, (), length)) for length in self.layout.dwells()]
        chosen: list[tuple[PlanDesign, float]] = []
        for seconds, made in sorted(tried, key=lambda one: one[0]):
            taken = {other.order for other, _ in chosen}
            if math.isfinite(seconds) and made.order not in taken and mirrored(made.order) not in taken:
                chosen.append((made, seconds))
        return chosen[:TRIED]

    def allowed(self, lacking: Array) -> Array:
        """What a plain design may lack before any exchange: columns that no pose changes are not mended by other poses."""
        if self.wish.parting is not None:
            return np.full(lacking.shape, ROUGH)
        return np.where(self.layout.alike(), 1.0, ROUGH)

    def guessed(self, order: tuple[float, ...], dwell_s: float) -> float:
        """Station time that an order will need, s, from two sizes of a plain design; infinite where no size will do."""
        few, many = 8, 40
        lacks: list[float] = []
        ends: list[float] = []
        for count in (few, many):
            lacking, seconds = self.layout.shortfall(PlanDesign(order, (count,) * len(order), dwell_s))
            lacks.append(float(np.max(lacking / self.allowed(lacking))))
            ends.append(seconds)
        self.nearest = min(self.nearest, lacks[1])
        slope = math.log(lacks[1] / lacks[0]) / math.log(many / few)
        if not slope < -0.02:
            return ends[0] if lacks[0] <= 1.0 else math.inf
        count = max(float(FEWEST), many * lacks[1] ** (-1.0 / slope))
        if count * len(order) > 2.0 * MOST:
            return math.inf
        return ends[0] + (ends[1] - ends[0]) * (count - few) / (many - few)

    def plain(self, made: PlanDesign) -> tuple[float, PlanDesign]:
        """A plain design with the fewest dwells, and its station time in s; infinite where none will do."""
        lacking, _ = self.layout.shortfall(replace(made, counts=(FEWEST,) * len(made.order)))
        found = fewest_dwells(self.layout, made, self.allowed(lacking))
        return (math.inf, made) if found is None else (self.layout.shortfall(found)[1], found)

    def best(self, made: PlanDesign, best: PlanContext | None) -> PlanContext | None:
        """The quicker of a recipe and the one found by exchanges in the soaks of a design."""
        now: PlanDesign | None = made
        for _ in range(ROUNDS):
            if now is None or self.slower(now, best):
                break
            found = self.designed(now)
            try:
                reached = self.reached(found)
            except NotIdentified:
                break
            worst = float(np.max(reached))
            self.nearest = min(self.nearest, worst)
            if self.near is None or worst < self.near[0]:
                self.near = (worst, found)
            if worst <= 1.0 and (best is None or _busy(found) < _busy(best)):
                self.unseen = self.blind(found)
                best = best if self.unseen else found
            if NEAR < worst <= 1.0 or self.unseen:
                break
            now = fewest_dwells(self.layout, made, (1.0 - SPARE) * self.layout.shortfall(now)[0] / reached)
        return best

    def nearest_within(self, lack: float) -> PlanContext | None:
        """The recipe that lacks least of the wish, where that is little, it is quicker, and blind to nothing asked for."""
        if self.near is None or self.near[0] > lack:
            return None
        found = self.near[1]
        return None if _busy(found) >= _busy(self.against) or self.blind(found) else found

    def slower(self, made: PlanDesign, best: PlanContext | None) -> bool:
        """Whether a design takes clearly longer than the best recipe so far."""
        return best is not None and self.layout.shortfall(made)[1] / 60.0 > SLOWER * _busy(best)

    def designed(self, made: PlanDesign) -> PlanContext:
        """The recipe with poses exchanged, as the station will go through it."""
        slots, start = self.layout.slots(made)
        choice = exchanged(slots, start, self.wish.value)
        choice = spanned(self.layout.force, choice, made.fixed, self.recipe.span_min_g)
        recipe = self._recipe(made, choice)
        return plan_context(recipe, self.against.station, self.against.noise, slowest=self.layout.slowest)

    def reached(self, found: PlanContext) -> Array:
        """What a recipe lacks of the wish, above one, with every dwell at its time."""
        expected = identified(found)
        if self.wish.parting is None:
            return expected.errors / self.wish.wanted
        sensor, _ = design.split(self.wish.effects)
        rows = design.local_columns(sensor, found.state, design.starting_values(sensor, found.state))
        rows = rows * self.wish.wanted[:, None, :]
        return self.wish.shortfall(np.swapaxes(rows, -1, -2) @ np.linalg.solve(found.covariance, rows))

    def _recipe(self, made: PlanDesign, choice: NDArray[np.intp]) -> Recipe:
        used = np.unique(choice)
        number = {int(c): k for k, c in enumerate(used, start=1)}
        chosen = self.wish.candidates[used]
        verification = apart(chosen, self.recipe.verification)
        soaks = [
            SoakPart(
                temperature_C=t,
                poses=[number[int(c)] for c in choice[made.group == soak]],
                verification=turns(len(verification), self.wish.verification, soak, len(made.order)),
            )
            for soak, t in enumerate(made.order)
        ]
        return self.recipe.model_copy(
            update={
                "name": f"{self.recipe.name}-optimal",
                "description": f"{len(chosen)} poses at {len(soaks)} soaks, as 'tumbleline plan optimise' found them",
                "poses": numbered("p", chosen),
                "verification": verification,
                "temperatures_C": [float(t) for t in made.order],
                "soaks": soaks,
                "dwell_s": made.dwell_s,
            }
        )

    def blind(self, found: PlanContext) -> list[str]:
        """Effects that must be seen and are not."""
        seen = {s.effect: s.left for s in sights(found.state, self.recipe.effects, 1.0, self.wish.see)}
        return [name for name in self.wish.see if seen.get(name, 1.0) < PART_SEEN]
