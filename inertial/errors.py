"""What the science refuses, as errors that name what was found and what is needed."""

from collections.abc import Iterable
from difflib import get_close_matches


class InertialError(ValueError):
    """Base of every refusal of this package."""


class UnknownEffect(InertialError):
    """An effect id that nothing in the catalogue answers to."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        self.name = name
        self.close = tuple(get_close_matches(name, list(known), n=3, cutoff=0.5))
        hint = f"did you mean {' or '.join(self.close)}" if self.close else "see the catalogue of effects for the ids"
        hint += "; one of a Python file needs --effect-file FILE.py, or to be installed as a package"
        super().__init__(f"effects: unknown effect '{name}'; an id of the catalogue is needed; {hint}")


class MissingInput(InertialError):
    """An effect needs a quantity that the dwells do not carry."""

    def __init__(self, effect: str, quantity: str) -> None:
        self.effect, self.quantity = effect, quantity
        super().__init__(f"{effect}: the dwells have no {quantity}; record it, or leave {effect} out of the model")


class BrokenEffect(InertialError):
    """A module that should hold an effect cannot be used."""


class NotIdentified(InertialError):
    """The plan cannot determine a coefficient that the model asks for."""
