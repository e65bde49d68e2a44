"""The JSON documents of imports: keys that other programs read."""

from typing import Annotated, Any, Literal, NotRequired

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


FaultName = Literal["stuck_output", "torn_words"]


class SampleFaultDocument(TypedDict):
    """A fault of samples."""

    fault: FaultName
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
    command: Annotated[
        str,
        "the proposed command: `import`, `diagnose` for a table of dwells in the exchange format, `plan` for angles alone",
    ]


class TransferParameter(TypedDict):
    """A parameter of the fitted transfer function."""

    value: float
    uncertainty: Annotated[float | None, "standard uncertainty; null if an end is open"]
    low: Annotated[float | None, "lower end of the 95 % interval; null: the points leave it open"]
    high: float | None
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
    device: Annotated[str | None, "kind of device; null: not stated"]
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
    alone_hz: Annotated[
        list[float], "frequencies of points that depart alone: no effect explains them, to be measured again"
    ]
    sensitivity: Annotated[float, "output per g"]
    bandwidth_hz: Annotated[float | None, "−3 dB frequency of the model; null: it does not fall by 3 dB"]
    parameters: dict[str, TransferParameter]
    next_hz: list[float]
    text: list[str]


class WaveformFigure(TypedDict):
    """A figure of a procedure from waveforms that were recorded elsewhere."""

    figure: str
    axis: str
    value: Annotated[float | None, "null: not determined, with `note`"]
    uncertainty: Annotated[float | None, "standard uncertainty, in `unit`"]
    unit: str
    identified: bool
    measured: Annotated[bool, "false: the files cannot hold it; `note` says what would give it"]
    note: str


class WaveformImport(TypedDict):
    """``import FILE… --procedure NAME --map reference=…``: figures and findings of a procedure."""

    run: str
    unit: str
    device: Annotated[str | None, "kind of device; null: not stated"]
    procedure: str
    records: int
    verdict: Annotated[str, "on the model of the test: adequate, not adequate, not judged; empty: it has none"]
    figures: list[WaveformFigure]
    text: list[str]


class SourcePart(TypedDict):
    """A file of a recording."""

    path: str
    sha256: str
    bytes: int
    form: str


class SourceDocument(SourcePart):
    """What was imported: a file, or several that were joined."""

    files: NotRequired[Annotated[list[SourcePart], "of a recording in several files"]]


class DwellDocument(TypedDict):
    """A dwell of an import."""

    dwell: int
    label: str
    start_s: float
    end_s: float
    n: Annotated[int | None, "samples; null: the file has dwells only"]
    mean: Annotated[list[float], "by axis"]
    sd: Annotated[list[float] | None, "by axis"]
    residual_ug: Annotated[float | None, "of the norm of gravity; null: no such fit"]
    influence: Annotated[float | None, "Cook's distance; above 1 the dwell dominates the fit"]


class ImportDocument(TypedDict):
    """``import FILE… --json``: a recording in the archive, with its fit. Keys after `dwell_list` are those of the fit."""

    run: str
    source: SourceDocument
    units: list[str]
    device: Annotated[str | None, "kind of device; null: not stated"]
    out_unit: str
    samples: int
    dwells: int
    remarks: list[str]
    faults: list[SampleFaultDocument]
    fit: Annotated[Literal["norm", "plane", "faces", "temperature"] | None, "null: no fit"]
    adequate: Annotated[bool | None, "null: cannot be judged, or no fit"]
    lines: Annotated[list[str], "the fit in words"]
    dwell_list: list[DwellDocument]
    reason: NotRequired[Annotated[str | None, "why it is not adequate, or cannot be judged"]]
    error: NotRequired[Annotated[dict[str, Any], "residual and noise, µg: `rms_ug`, `floor_ug`, `p_value` and others"]]
    evidence: NotRequired[Annotated[Any, "of `norm` and `faces`, as in `diagnose --json`"]]
    leave_out: NotRequired[Annotated[Any, "of `norm`, as in `diagnose --json`"]]
    missing: NotRequired[Annotated[list[list[str]], "of `norm`: classes of effects that are missing"]]
    bias: NotRequired[Annotated[list[float], "by axis, in `out_unit`"]]
    bias_less_six_parameters: NotRequired[
        Annotated[list[float] | None, "of `norm`: what the six-parameter fit has less"]
    ]
    bias_u_record: NotRequired[Annotated[list[float], "of `norm`: standard uncertainty as the bias of this record"]]
    bias_u_day: NotRequired[Annotated[list[float], "of `norm`: the same as the bias of any day"]]
    bias_u: NotRequired[Annotated[list[float], "of `plane`: standard uncertainty"]]
    response_per_g: NotRequired[Annotated[list[list[float]], "(3, 3), `out_unit` per g"]]
    response_u: NotRequired[Annotated[list[list[float]], "of `plane`: standard uncertainty"]]
    scale_per_m_s2: NotRequired[Annotated[list[float], "by axis"]]
    published: NotRequired[Annotated[dict[str, Any], "of `faces`: the published method"]]
    least_squares: NotRequired[
        Annotated[dict[str, Any], "of `faces`: bias, response, standard uncertainties, and residuals of each output"]
    ]
    across: NotRequired[Annotated[str, "of `plane`: the axis across the plane"]]
    open: NotRequired[Annotated[list[str], "of `plane`: what the plane does not show"]]
    temperature_offset_per_C: NotRequired[Annotated[list[float] | None, "of `norm`: change of the bias, µg/K"]]
    reference_C: NotRequired[Annotated[float | None, "at which the values hold"]]
    coefficients: NotRequired[Annotated[list[list[float]], "of `temperature`: cubic of each axis"]]
    residual_rms: NotRequired[Annotated[list[float], "of `temperature`, in `out_unit`"]]
    noise: NotRequired[Annotated[list[float], "of `temperature`, in `out_unit`"]]


class ImportsDocument(TypedDict):
    """``import FILE FILE… --json``: several recordings, each in its own run."""

    imports: list[ImportDocument]
    adequate: Annotated[bool | None, "false if one fit is not adequate; null if one cannot be judged"]
