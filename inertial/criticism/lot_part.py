"""The sample of a lot in which effects are searched, and the curves that are suspected in it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inertial import decisions
from inertial.criticism.drivers import Driver
from inertial.criticism.field import Candidates
from inertial.criticism.search import anything
from inertial.criticism.unknown import Unexplained, better_curve, suspects, unexplained_by, wide_suspects
from inertial.estimation.alternative import Handling
from inertial.estimation.model import Model
from inertial.estimation.penalty import cost_of_model
from inertial.estimation.problem import Problem
from inertial.estimation.term import Term

_MANY = 32  # largest number of units of a lot that is searched completely
_MANY_EFFECTS = 3  # chosen effects from which on curves of every kind are suspected
_ENOUGH = 24  # units, distributed over a larger lot, that are searched


@dataclass(frozen=True)
class LotPart:
    """The units of a lot in which effects are searched: effects common to a large lot are visible in two dozen units.

    wide : whether curves of every kind are suspected from the beginning
    """

    field: Candidates
    base: Model
    wide: bool = False

    def suspected(self, chosen: Sequence[Term]) -> list[Driver]:
        """Suspected curves of every driver; of every kind with many chosen effects, or where a drift imitated sudden changes."""
        return self.every_suspect if self.wide or len(chosen) >= _MANY_EFFECTS else self._plain

    @cached_property
    def _plain(self) -> list[Driver]:
        return suspects(self.field.problem)

    @cached_property
    def every_suspect(self) -> list[Driver]:
        """Curves of every driver and of every kind."""
        return [*self._plain, *wide_suspects(self.field.problem)]

    def imitates(self, chosen: Sequence[Term]) -> bool:
        """Whether chosen effects only imitate a curve of one driver: it is far better, or leaves no further effect."""
        better = better_curve(self.base, chosen, self.suspected(chosen))
        if better is None:
            return False
        fit = better[0]
        problem = self.field.problem
        effects = cost_of_model(Model(problem, [*self.base.terms, *chosen], near=fit.model.noise))
        by_far = effects - fit.cost > decisions.CURVE_SHARE * (cost_of_model(self.base) - fit.cost)
        return by_far or not anything(self.field, fit.model)

    def drift_of(self, changes: Sequence[Term], further: Sequence[Term]) -> tuple[Unexplained, frozenset[str]] | None:
        """The drift that sudden changes imitate together with further terms, and the ids of these changes; None if there is none.

        One step of the reader's reference is an event, but a slowly changing scale factor looks like two successive steps, and a
        bending fixture looks like a moved fixture with temperature-dependent misalignments. A single change is never doubted,
        because known causes have priority.

        Parameters
        ----------
        changes : terms of the judged model that are changes of handling
        further : effects or changes beyond that model
        """
        known = {t.key for t in changes}
        held = [t for t in self.base.terms if t.key in known]
        if not held or len(held) + len(further) < 2:
            return None
        base = Model(self.field.problem, [t for t in self.base.terms if t.key not in known], near=self.base.noise)
        better = better_curve(base, [*held, *further], self.every_suspect)
        if better is None:
            return None
        fit, terms = better
        remaining = {t.key for t in terms}
        imitations = frozenset(t.effect.id for t in held if t.key not in remaining)
        return (unexplained_by(base, fit, len(self.every_suspect)), imitations) if imitations else None


def part_of(field: Candidates, base: Model, *, wide: bool) -> LotPart:
    """A sample of the units of a large lot, without units with a handling error of their own; a small lot completely."""
    lot = field.problem.lot
    count = lot.state.time.shape[0]
    if count <= _MANY:
        return LotPart(field, base, wide)
    of_one_unit = {
        int(np.mean(t.keywords["unit"])) for t in base.terms if isinstance(t.effect, Handling) and "unit" in t.keywords
    }
    sound = [unit for unit in range(count) if unit not in of_one_unit]
    pick = np.array(sound)[np.linspace(0, len(sound) - 1, min(_ENOUGH, len(sound))).round().astype(int)]
    slope = field.problem.slope
    problem = Problem(lot.units(pick.tolist()), slope=None if slope is None else slope[pick])
    problem.covariance.like(field.problem.covariance)
    terms = [t for t in base.terms if not (isinstance(t.effect, Handling) and "unit" in t.keywords)]
    return LotPart(
        Candidates(problem, field.effects, [a for a in field.handling if a.in_part]), Model(problem, terms), wide
    )
