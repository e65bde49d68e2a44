"""An effect written as formulas in a model file, a user's hypothesis: tried like every other effect."""

from collections.abc import Sequence

from inertial.effects.base import Array, SensorEffect, stack
from inertial.expressions import Expression
from inertial.state import State


class Formula(SensorEffect):
    """An effect made at run time from formulas, one per column.

    Parameters
    ----------
    name : its id
    columns : formulas over the names of :mod:`inertial.expressions` and the recorded columns
    why : the physics that is meant, in a line
    symbol : of the coefficients, which are numbered where there are several
    typical_ug : range of plausible sizes, µg

    Raises
    ------
    FormulaInvalid
        A formula is no formula.
    """

    source = "a formula of a model file"
    breaker = "vary the quantities of the formula, each alone"
    simplicity = 55

    def __init__(
        self,
        name: str,
        columns: Sequence[str],
        *,
        why: str = "",
        symbol: str = "c",
        typical_ug: tuple[float, float] = (1.0, 10000.0),
    ) -> None:
        self.formulas = tuple(Expression(text, f"formula {name}") for text in columns)
        self.id = name  # type: ignore[misc]  # made at run time: what is per class elsewhere is per instance here
        self.symbol = symbol or "c"  # type: ignore[misc]
        self.equation = " + ".join(  # type: ignore[misc]
            f"{label}·({text})" for label, text in zip(self.names(0), columns, strict=True)
        )
        self.typical_ug = typical_ug  # type: ignore[misc]
        self.__doc__ = why or f"Formula over {', '.join(self.quantities)}."

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names that the formulas speak of."""
        return tuple(dict.fromkeys(name for formula in self.formulas for name in formula.names))

    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        """The formulas at every dwell, (..., n, p)."""
        return stack(state, [formula.values(state, axis) for formula in self.formulas])

    def names(self, axis: int) -> tuple[str, ...]:
        """Names of the coefficients."""
        if len(self.formulas) == 1:
            return (self.symbol,)
        return tuple(f"{self.symbol}{k + 1}" for k in range(len(self.formulas)))
