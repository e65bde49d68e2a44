"""A fault of a simulated station: its kind, target, start and duration.

The kinds are defined in ``stations/plant/faults``. This module defines the notation in station files, recipes, command lines and
tests.
"""

import math
from typing import Annotated, Literal

from pydantic import Field, ValidationError, model_validator

from schemas.bounds import LARGEST_TIME_S, Number, Text
from schemas.errors import WrongUse
from schemas.foreign import shown
from schemas.strict import Strict
from schemas.toml_files import reason_of

Part = Literal["", "outer", "inner", "chamber", "reader"]
SEPARATOR = ":"


class FaultOrder(Strict):
    """A fault from ``at_s`` on the clock of the simulated station, for ``for_s`` seconds or permanently.

    The target is the unit ``serial`` or the device ``device`` of the station; ``figures`` are the parameters of the kind.
    """

    kind: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    at_s: Annotated[Number, Field(ge=0.0, le=LARGEST_TIME_S)] = 0.0
    for_s: Annotated[Number, Field(gt=0.0, le=LARGEST_TIME_S)] | None = None
    serial: Text = ""
    device: Part = ""
    figures: dict[str, Number] = Field(default_factory=dict[str, float])

    @model_validator(mode="after")
    def _one_target(self) -> "FaultOrder":
        if self.serial and self.device:
            raise ValueError(
                f"fault {self.kind}: serial '{self.serial}' and device '{self.device}', only one of the two is allowed; "
                "correct the fault"
            )
        return self

    @property
    def until_s(self) -> float:
        """End of the fault, s; infinite for a permanent fault."""
        return math.inf if self.for_s is None else self.at_s + self.for_s


def parse_fault(text: str) -> FaultOrder:
    """The fault in ``kind[:key=value…]``: keys of a fault, or figures of its kind.

    >>> parse_fault("silent:serial=U001:at_s=905").at_s
    905.0
    """
    kind, *pairs = text.split(SEPARATOR)
    keys: dict[str, str | dict[str, str]] = {"kind": kind}
    figures: dict[str, str] = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not key or not value:
            raise WrongUse(
                f"fault '{shown(text)}': found '{shown(pair)}', key=value is needed; write kind:key=value:key=value"
            )
        (keys if key in FaultOrder.model_fields and key != "figures" else figures)[key] = value
    try:
        return FaultOrder.model_validate_strings({**keys, "figures": figures})
    except ValidationError as problem:
        detail = problem.errors(include_url=False)[0]
        where, sentence = ".".join(str(part) for part in detail["loc"] if part != "figures"), reason_of(detail)
        if where:
            sentence = f"{where}: {sentence[:1].lower()}{sentence[1:]}"
        raise WrongUse(f"fault '{shown(text)}': {sentence}; write kind:key=value:key=value") from None
