"""What ``import`` prints of a dynamic measurement as JSON."""

from __future__ import annotations

from typing import Annotated

from typing_extensions import TypedDict


class TransferParameter(TypedDict):
    """A parameter of the fitted transfer function."""

    value: float
    uncertainty: Annotated[float, "standard uncertainty"]
    low: Annotated[float, "lower end of the 95 % interval"]
    high: float
    unit: str
    identified: Annotated[bool, "whether the points determine it"]


class TransferFailure(TypedDict):
    """Where a model of a transfer function fails."""

    low_hz: float
    high_hz: float
    part: Annotated[str, "magnitude or phase"]
    share: Annotated[float, "of χ²"]


class TransferClass(TypedDict):
    """Missing effects that the points do not tell apart."""

    effects: list[str]
    p_value: float


class TransferImport(TypedDict):
    """``import FILE --procedure sweep``: the diagnosis of a transfer function."""

    run: str
    unit: str
    points: int
    adequate: Annotated[bool | None, "null: cannot be judged, with `reason`"]
    reason: str
    model: list[str]
    p_value: float
    error_percent: Annotated[float, "rms of the relative complex residual"]
    extended_percent: Annotated[float, "the same with the recommended effects"]
    left_out: Annotated[list[float | None], "rms residual of left-out points before and after, standard uncertainties"]
    where: list[TransferFailure]
    classes: list[TransferClass]
    recommended: list[str]
    unexplained: bool
    sensitivity: Annotated[float, "output per g"]
    bandwidth_hz: Annotated[float | None, "−3 dB frequency of the model; null: it does not fall so far"]
    parameters: dict[str, TransferParameter]
    next_hz: list[float]
    text: list[str]
