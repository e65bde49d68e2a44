"""The JSON documents of plan and choose: keys that other programs read. A key that is NotRequired may be missing."""

from typing import Annotated, Any, NotRequired

from typing_extensions import TypedDict


class DwellError(TypedDict):
    """Expected standard error of one dwell, µg."""

    white: float
    wander: float
    together: float


class DwellTime(TypedDict):
    """Length of a dwell, s."""

    planned: float
    white_as_large_as_wander: float | None


class StationMinutes(TypedDict):
    """Station time, min."""

    soaks: float
    moves: float
    dwells: float
    static_record: float
    procedures: NotRequired[float]
    total: float
    power_off: NotRequired[float]


class PlannedCoefficient(TypedDict):
    """Expected uncertainty of one coefficient of the recipe's model."""

    effect: str
    name: str
    axis: Annotated[str, "`*`: shared by all units"]
    uncertainty_ug: Annotated[float, "standard uncertainty, in `unit`"]
    unit: str


UnseenRange = TypedDict(
    "UnseenRange",
    {"parameter": str, "unit": str, "from": float, "to": float, "text": Annotated[str, "the same in words"]},
)


class PlannedEffect(TypedDict):
    """What the plan can see of one effect of the catalogue."""

    effect: str
    seen: bool
    left: Annotated[float, "fraction of the effect that the other effects do not cover, 0 … 1"]
    variance_inflation: Annotated[float | None, "1/left²; null if nothing remains"]
    floor_ug: Annotated[float | None, "smallest coefficient that is detected (3σ), in `floor_unit`; null: none"]
    alias: Annotated[list[str], "effects that it is mistaken for"]
    breaker: Annotated[str, "a measurement that would show it"]
    left_by_axis: NotRequired[list[float]]
    floor_unit: NotRequired[str | None]
    floor_size_ug: NotRequired[Annotated[float | None, "the same as a specific force, µg"]]
    floor_white_ug: NotRequired[
        Annotated[float | None, "`floor_size_ug` with white noise only, without 1/f and random walk"]
    ]
    typical_ug: NotRequired[Annotated[list[float], "usual size, from and to, µg"]]
    faint: NotRequired[Annotated[bool, "whether its usual size is below the smallest detected one"]]
    alias_exact: NotRequired[list[str]]
    why: NotRequired[Annotated[str, "what hides it; empty if it is seen"]]
    unseen_ranges: NotRequired[Annotated[list[UnseenRange], "values of its parameters at which it is not seen"]]


class PlannedBias(TypedDict):
    """Expected standard uncertainty of the bias by measurand, of the worst axis."""

    record_u_ug: Annotated[float, "as the mean of the record, µg"]
    long_u_ug: Annotated[float, "as the mean of the time after the record, µg"]
    long_s: Annotated[float, "length of that time, s"]
    switch_on_u_ug: Annotated[float | None, "after the next switch-on, µg; null: not stated"]
    switch_on_why: NotRequired[Annotated[str, "why that is not stated"]]


class ReachableQuantity(TypedDict):
    """The uncertainty that a recipe can reach of one quantity."""

    quantity: Annotated[
        str,
        "`bias_error`: by the references alone; `bias_error_period`: RMS expected over the period; "
        "`bias_error_largest`: 95 % bound of the largest of the three",
    ]
    axis: str
    unit: str
    u: Annotated[float, "standard uncertainty, in `unit`"]
    expanded: Annotated[float, "k·u"]
    shares: Annotated[dict[str, float], "contribution to u², by name, the largest first"]


class ReachableUncertainty(TypedDict):
    """Uncertainty that the recipe can reach with what station and device state."""

    k: float
    frame: Annotated[str, "`intrinsic` or `fixture`"]
    validity_months: int
    grade_source: str
    not_stated: Annotated[
        dict[str, str], "entries of `[uncertainty]` that are missing, with the quantities that each dominates"
    ]
    quantities: list[ReachableQuantity]
    unreachable: Annotated[list[str], "limits that cannot be met, and why; empty: none"]
    at_risk: Annotated[list[str], "limits that can be met, but noise alone makes good units miss; empty: none"]
    remarks: list[str]


class PlannedFigure(TypedDict):
    """A figure that a procedure determines."""

    figure: str
    unit: str
    meaning: str
    limit: Annotated[str | None, "in `unit`; null: none"]


class PlannedProcedure(TypedDict):
    """One entry of the recipe's list of procedures."""

    procedure: str
    states: Annotated[str, "its results in one line"]
    records: int
    minutes: Annotated[float, "station time, min"]
    temperatures_C: list[float]
    equipment: Annotated[list[str], "that the station must have"]
    figures: list[PlannedFigure]


class PlanDocument(TypedDict):
    """``plan --json``: what a recipe can determine, with its station time and expected uncertainties."""

    effects: Annotated[list[PlannedEffect], "empty for a list of procedures without the multi-position test"]
    procedures: NotRequired[list[PlannedProcedure]]
    recipe: NotRequired[str]
    device: NotRequired[str]
    station: NotRequired[str]
    model: NotRequired[list[str]]
    poses: NotRequired[int]
    dwells: NotRequired[int]
    temperatures_C: NotRequired[list[float]]
    dwell_error_ug: NotRequired[DwellError]
    dwell_s: NotRequired[DwellTime]
    minutes: NotRequired[StationMinutes]
    coefficients: NotRequired[list[PlannedCoefficient]]
    bias: NotRequired[Annotated[PlannedBias | None, "null: the model has no bias"]]
    uncertainty: NotRequired[Annotated[ReachableUncertainty | None, "null: noise only, no `[uncertainty]` is stated"]]
    page: NotRequired[Annotated[str, "path of the page that `--output` wrote"]]


class ChoiceRow(TypedDict):
    """A kind of device with a calibration."""

    device: str
    calibration: Annotated[str, "a key of `calibrations`"]
    reaches: Annotated[bool, "the error that is asked for, and range, bandwidth and temperatures"]
    error_ug: Annotated[float, "at the end of the range, with the coverage factor"]
    terms_ug: Annotated[dict[str, float], "standard uncertainties by term"]
    range_over_noise_dB: Annotated[float | None, "the range over the noise in the bandwidth; null: no noise is stated"]
    cannot: Annotated[list[str], "what no calibration mends: range, bandwidth, temperatures"]
    why: Annotated[list[str], "why it does not reach the error; empty: it does"]


class ChoiceDocument(TypedDict):
    """``plan choose --json``: which kind of device, with which calibration, reaches an error."""

    range_g: float
    temperatures_C: list[float]
    bandwidth_hz: float
    error_ug: Annotated[float, "that is asked for"]
    coverage_factor: float
    calibrations: Annotated[dict[str, str], "what each calibration is"]
    assumptions: list[str]
    candidates: Annotated[list[ChoiceRow], "those that reach the error first"]


class LineActivity(TypedDict):
    """Something that happens to a lot on a line; times are from the start."""

    lot: str
    fixture: str
    activity: Annotated[
        str,
        "`load`, `change`, `soak`, `measure`, `ramp`, `static`, `return` to the room, `unload`, or a role of equipment",
    ]
    temperature_C: Annotated[float | None, "null: of the lot as it is"]
    begin_min: float
    end_min: float
    resources: Annotated[list[str], "shared resources that it holds; `operator`"]


class LineLot(TypedDict):
    """A lot of a line."""

    lot: str
    recipe: str
    fixture: str
    loaded_min: Annotated[float, "begin of its loading"]
    unloaded_min: Annotated[float, "end of its unloading"]
    wait_min: Annotated[float, "that it waits at a temperature, min"]


class LineResource(TypedDict):
    """The use of a shared resource, of the fixtures or of the operators by the lots of a line."""

    resource: str
    count: int
    minutes_per_lot: float
    bound_per_lot_min: Annotated[float, "minutes per lot below which no schedule of many lots is, because of it"]


class LineRate(TypedDict):
    """The duration and throughput of a schedule."""

    makespan_min: Annotated[float, "from the start until the last lot is unloaded"]
    minutes_per_lot: float
    lots_per_day: float


class LineDocument(TypedDict):
    """``plan line --json``: the shortest schedule of the lots of a line."""

    line: str
    station: Annotated[str, "whose timing it is"]
    solver: str
    start_min: Annotated[float, "time of day of the start, min"]
    makespan_min: Annotated[float, "from the start until the last lot is unloaded"]
    bound_min: Annotated[float, "no schedule with a change before each stay on what is shared is shorter"]
    proven: Annotated[bool, "whether none of those is shorter than this one"]
    minutes_per_lot: float
    lots_per_day: float
    one_after_another: Annotated[LineRate, "the same lots, each when the one before is unloaded"]
    lots: list[LineLot]
    resources: Annotated[list[LineResource], "the critical one first"]
    activities: Annotated[list[LineActivity], "in order of their begin"]


def worst_axes(reach: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The row with the largest uncertainty of each quantity that a plan can reach."""
    worst: dict[str, dict[str, Any]] = {}
    for row in reach["quantities"]:
        if row["quantity"] not in worst or row["u"] > worst[row["quantity"]]["u"]:
            worst[row["quantity"]] = row
    return worst
