"""The JSON documents of imports: keys that other programs read."""

from __future__ import annotations

from typing import Annotated, Literal

from typing_extensions import TypedDict


class ColumnDocument(TypedDict):
    """A column of a file."""

    name: str
    number: Annotated[int, "from 1"]
    meaning: Annotated[str, "guessed; empty if unknown"]
    reason: str
    unit: Annotated[str, "as the file states it, or as guessed"]
    missing: Annotated[int, "rows without a number"]
    low: float | None
    high: float | None
    resolution: Annotated[float | None, "step of the lattice of its values; null if there is none"]
    clipped: Annotated[int, "consecutive samples at an extreme, as at the end of a range"]


class SampleFaultDocument(TypedDict):
    """A fault of samples."""

    fault: Literal["stuck_output", "torn_words"]
    axis: str
    first_row: int
    samples: int
    start_s: float
    offsets_lsb: list[int]


class IntervalDocument(TypedDict):
    """A static interval."""

    start_s: float
    end_s: float
    samples: int
    mean: list[float]
    sd: list[float]
    positions: Annotated[int, "number of positions logged back to back; 1 for one dwell"]


class InspectDocument(TypedDict):
    """``inspect FILE --json``: the content of a file and its probable meaning; nothing is stored."""

    files: list[str]
    form: str
    rows: int
    columns: list[ColumnDocument]
    remarks: list[str]
    time_unit: str
    time_reason: str
    output_unit: str
    output_reason: str
    rate_hz: float | None
    duration_s: float | None
    gaps: int
    faults: list[SampleFaultDocument]
    intervals: list[IntervalDocument]
    open: Annotated[list[str], "values that the file does not state and the command lacks"]
    command: Annotated[str, "the proposed import command"]


class TransferParameter(TypedDict):
    """A parameter of the fitted transfer function."""

    value: float
    uncertainty: Annotated[float, "standard uncertainty"]
    low: Annotated[float, "lower end of the 95 % interval"]
    high: float
    unit: str
    identified: Annotated[bool, "whether the points determine it"]


class TransferFailure(TypedDict):
    """A frequency range in which a model of a transfer function fails."""

    low_hz: float
    high_hz: float
    part: Annotated[str, "magnitude or phase"]
    share: Annotated[float, "of χ²"]


class TransferClass(TypedDict):
    """Missing effects that the points do not separate."""

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
    bandwidth_hz: Annotated[float | None, "−3 dB frequency of the model; null: it does not fall by 3 dB"]
    parameters: dict[str, TransferParameter]
    next_hz: list[float]
    text: list[str]
