"""A small language of formulas over what the dwells carry: arithmetic and a few functions, nothing that could do harm.

A formula is read by Python's own parser and walked by hand: what is not listed here is refused, so that a model file from
anywhere can be loaded without running anything.
"""

import ast
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from typing import NoReturn

import numpy as np

from inertial.arrays import Array
from inertial.errors import InertialError, MissingInput
from inertial.quantities import formula_names
from inertial.state import State

FUNCTIONS: Mapping[str, tuple[int, Callable[..., Array]]] = {
    "abs": (1, np.abs),
    "sqrt": (1, np.sqrt),
    "exp": (1, np.exp),
    "log": (1, np.log),
    "sin": (1, np.sin),
    "cos": (1, np.cos),
    "tanh": (1, np.tanh),
    "sign": (1, np.sign),
    "minimum": (2, np.minimum),
    "maximum": (2, np.maximum),
}

FORCES: Mapping[str, str] = {
    "f": "specific force along the own axis, g",
    "fj": "specific force along the next axis (x → y → z → x), g",
    "fk": "specific force along the axis after that, g",
}

QUANTITIES: Mapping[str, tuple[str, float, str]] = formula_names()
"""Name in a formula: name in the state, factor, meaning."""

NAMES = (*FORCES, *QUANTITIES)

_BINARY: Mapping[type[ast.operator], Callable[[Array, Array], Array]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}
_LONGEST = 500  # characters of a formula
_LARGEST = 1e100  # number in it: its powers stay finite


class FormulaInvalid(InertialError):
    """A formula that cannot be used: its author changes it."""


class UnknownName(MissingInput):
    """A formula speaks of a quantity that the dwells do not carry."""

    def __init__(self, where: str, name: str, known: list[str]) -> None:
        super().__init__(where, name)
        close = get_close_matches(name, known, n=3, cutoff=0.55)
        hint = f"did you mean {' or '.join(close)}?" if close else f"known: {', '.join(known)}"
        self.args = (f"{where}: the dwells have no '{name}'; record it, or correct the formula; {hint}",)


class Expression:
    """A formula that was read and found usable.

    Parameters
    ----------
    text : as in a model file
    where : what messages begin with
    """

    def __init__(self, text: str, where: str) -> None:
        self.text, self.where = text, where
        self._tree = self._parsed()
        self._check(self._tree)
        if not self.names:
            self._refuse(f"'{text}' depends on nothing, a quantity of the dwells is needed; bias is a constant already")

    @property
    def names(self) -> tuple[str, ...]:
        """Quantities and columns that it speaks of, each once."""
        called = {n.func.id for n in ast.walk(self._tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}
        names = [n.id for n in ast.walk(self._tree) if isinstance(n, ast.Name)]
        return tuple(dict.fromkeys(name for name in names if name not in called))

    @property
    def covariates(self) -> tuple[str, ...]:
        """Names that only a column of the dwells can answer to."""
        return tuple(name for name in self.names if name not in NAMES)

    def values(self, state: State, axis: int) -> Array:
        """The formula at every dwell, (..., n).

        Raises
        ------
        UnknownName
            The dwells carry no quantity of that name.
        FormulaInvalid
            A value is not finite.
        """
        with np.errstate(all="ignore"):
            values = np.broadcast_to(self._value(self._tree, state, axis), state.force.shape[:-1]).astype(np.float64)
        bad = int(np.count_nonzero(~np.isfinite(values)))
        if bad:
            self._refuse(
                f"'{self.text}' is not finite in {bad} of {values.size} dwells; mind roots, logarithms and quotients"
            )
        return values

    def _parsed(self) -> ast.expr:
        if len(self.text) > _LONGEST:
            self._refuse(f"{len(self.text)} characters, at most {_LONGEST} are read; split the formula into columns")
        try:
            return ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError) as problem:
            reason = problem.msg if isinstance(problem, SyntaxError) else str(problem)
            self._refuse(f"'{self.text}' is no formula ({reason}); write for instance 'humidity_pct * f'")

    def _check(self, node: ast.expr) -> None:
        """Refuse everything that is not arithmetic, a listed function or a name."""
        match node:
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                self._check(left)
                self._check(right)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
                self._check(operand)
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool) and abs(value) < _LARGEST:
                return
            case ast.Name():
                self._check_name(node.id)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                self._check_call(name, arguments)
            case _:
                part = ast.unparse(node)
                self._refuse(f"'{part}' is not allowed; numbers, names, + - * / ** and {', '.join(FUNCTIONS)} are")

    def _check_name(self, name: str) -> None:
        if name in FUNCTIONS:
            self._refuse(f"'{name}' is a function; write {name}(…)")
        if name.startswith("_"):
            self._refuse(f"'{name}' is no name of a quantity; names begin with a letter")

    def _check_call(self, name: str, arguments: list[ast.expr]) -> None:
        if name not in FUNCTIONS:
            close = get_close_matches(name, FUNCTIONS, n=2, cutoff=0.5)
            hint = f"did you mean {' or '.join(close)}?" if close else f"known: {', '.join(FUNCTIONS)}"
            self._refuse(f"unknown function '{name}'; {hint}")
        needed = FUNCTIONS[name][0]
        if len(arguments) != needed:
            self._refuse(f"{name} has {len(arguments)} arguments, {needed} needed")
        for argument in arguments:
            self._check(argument)

    def _value(self, node: ast.expr, state: State, axis: int) -> Array:
        if isinstance(node, ast.BinOp):
            return _BINARY[type(node.op)](self._value(node.left, state, axis), self._value(node.right, state, axis))
        if isinstance(node, ast.UnaryOp):
            inner = self._value(node.operand, state, axis)
            return -inner if isinstance(node.op, ast.USub) else inner
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            return FUNCTIONS[node.func.id][1](*(self._value(a, state, axis) for a in node.args))
        if isinstance(node, ast.Name):
            return self._quantity(node.id, state, axis)
        return np.asarray(float(ast.literal_eval(node)))

    def _quantity(self, name: str, state: State, axis: int) -> Array:
        if name in FORCES:
            return state.force[..., (axis + list(FORCES).index(name)) % 3]
        if name in state.covariates:
            return state.covariates[name]
        if name in QUANTITIES:
            attribute, factor, _ = QUANTITIES[name]
            value = getattr(state, attribute)
            if value is not None:
                return factor * value
        raise UnknownName(self.where, name, sorted({*NAMES, *state.covariates}))

    def _refuse(self, message: str) -> NoReturn:
        raise FormulaInvalid(f"{self.where}: {message}")
