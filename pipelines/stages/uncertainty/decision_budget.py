"""The uncertainty budget of a lot as far as decisions read it, without its tables: quantities are computed when they are read."""

from collections.abc import Iterator, Mapping

import numpy as np

from inertial.arrays import Array
from pipelines.stages.figures.base import BudgetRow
from pipelines.stages.uncertainty.budget import lot_budget
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms
from pipelines.stages.uncertainty.measurands import PARTS, part_of
from pipelines.stages.uncertainty.tables import combined, groups_of
from pipelines.tables.calibration import symmetric

Key = tuple[str, str]
"""Name and axis of a quantity."""


class DecisionBudget:
    """The quantities of a budget by unit, with the numbers of the table ``uncertainties``.

    covariance : (units, 3p, 3p), of the coefficients by the budget, output unit²

    Parameters
    ----------
    tables, terms : those of the budget; a statement is needed, and at least one unit that was fitted
    """

    def __init__(self, tables: BudgetTables, terms: BudgetTerms) -> None:
        parts = [_PartBudget(part, terms) for part in tables.parts()]
        self._parts = {unit: (part, index) for part in parts for index, unit in enumerate(part.units)}
        every = np.concatenate([part.covariance for part in parts])
        order = list(self._parts)
        self.covariance: Array = every[[order.index(unit) for unit in tables.calibrated().units]]

    def of(self, unit: str) -> Mapping[Key, BudgetRow]:
        """The quantities of a unit by name and axis; none for an unknown unit."""
        return _UnitBudget(*self._parts[unit]) if unit in self._parts else {}


class _PartBudget:
    """The budget of units with the same dwells; covariance as in :class:`DecisionBudget`."""

    def __init__(self, tables: BudgetTables, terms: BudgetTerms) -> None:
        self._lot = lot_budget(tables, terms)
        self.units = self._lot.calibration.units
        self._groups = groups_of(self._lot.variances)
        self._known: dict[str, dict[Key, list[BudgetRow]]] = {}
        covariance = symmetric(self._lot.variances.fit.covariance())
        self.covariance: Array = np.broadcast_to(covariance, (len(self.units), *covariance.shape[-2:]))

    def rows(self, name: str) -> Mapping[Key, list[BudgetRow]]:
        """The quantities of the part of the budget with a name, for every unit in order; none for an unknown name."""
        part = PARTS.get(name, "")
        if part and part not in self._known:
            self._known[part] = {}
            for quantity in part_of(part, self._lot, decisions=True):
                parts = quantity.value, *combined(quantity, self._groups)
                columns = (np.asarray(values, dtype=float).tolist() for values in parts)
                self._known[part][quantity.name, quantity.axis] = [
                    BudgetRow(*row) for row in zip(*columns, strict=True)
                ]
        return self._known.get(part, {})


class _UnitBudget(Mapping[Key, BudgetRow]):
    """The quantities of the unit with this index in its part of the lot."""

    def __init__(self, lot: _PartBudget, index: int) -> None:
        self._lot, self._index = lot, index

    def __getitem__(self, key: Key) -> BudgetRow:
        return self._lot.rows(key[0])[key][self._index]

    def __iter__(self) -> Iterator[Key]:
        return iter(dict.fromkeys(key for name in PARTS for key in self._lot.rows(name)))

    def __len__(self) -> int:
        return len(list(iter(self)))


def decision_budget(tables: BudgetTables, terms: BudgetTerms) -> DecisionBudget | None:
    """The budget of a lot for decisions; None where no uncertainty is stated, or no unit was fitted."""
    return None if terms.stated is None or tables.coefficients.empty else DecisionBudget(tables, terms)
