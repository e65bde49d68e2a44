"""The JSON documents of diagnose, compare and history: keys that other programs read.

A required key is never renamed or left out; a key that is NotRequired may be missing. Errors are divided by each unit's
scale, in µg.
"""

from typing import Annotated, Any, Literal, NotRequired

from typing_extensions import TypedDict


class BlockingFault(TypedDict):
    """A data fault; its units are not judged."""

    fault: str
    units: list[str]
    dwells: list[int]
    evidence: str


class NoiseFigures(TypedDict):
    """The noise that was estimated; missing where every unit has a data fault."""

    wander_share: NotRequired[Annotated[float, "variance of the 1/f noise over that of the white noise"]]
    walk_share: NotRequired[
        Annotated[float, "variance of the random walk at the end of the run over that of the white noise"]
    ]
    noise_spread: NotRequired[Annotated[float, "largest standard deviation of a unit and axis over the smallest"]]


class ErrorFigures(NoiseFigures):
    """Residual of the model; null where every unit has a data fault."""

    rms_ug: Annotated[float | None, "root mean square residual of the units without a fault, µg"]
    floor_ug: Annotated[
        float | None, "noise of the measurement: what it leaves in the residuals of a correct model, µg"
    ]
    white_noise_ug: NotRequired[Annotated[float | None, "white noise alone, from the samples of each dwell, µg"]]
    p_value: Annotated[float | None, "probability of such a residual if the model is adequate, at least 1e-300"]


class FailingDriver(TypedDict):
    """A recorded quantity that the residual depends on."""

    driver: str
    axes: list[str]
    share: Annotated[float, "share of the excess residual that the driver explains"]
    p_value: float


class NamedDwell(TypedDict):
    """A dwell of a unit."""

    unit: str
    dwell: int


class InfluentialDwell(NamedDwell):
    """A dwell with a large influence on the verdict."""

    share: Annotated[float, "share of the dwell in the evidence"]


class WithoutInfluence(TypedDict):
    """The verdict without the dwells of largest influence."""

    dwells: Annotated[int, "number of dwells left out"]
    p_value: float


class EffectClassDocument(TypedDict):
    """Effects that this plan cannot separate; one effect if it is identified."""

    effects: Annotated[list[str], "ids, the simplest first"]
    scope: Literal["sensor", "slot", "station", "sensor or station", "data"]
    rms_after_ug: Annotated[float, "residual with the effect added, µg"]
    heldout_after_ug: Annotated[
        float | None, "cross-validated residual with the effect added, µg; null: cannot be judged"
    ]
    heldout_before_ug: NotRequired[Annotated[float | None, "the same without the effect, µg"]]
    p_value: float
    size_ug: Annotated[float, "size of the effect, µg"]
    nonlinear: Annotated[dict[str, Any], "estimated time constants, widths, …"]
    nonlinear_of: NotRequired[Annotated[str | None, "the effect of the class that they belong to"]]
    nonlinear_interval: NotRequired[Annotated[dict[str, Any], "68 % interval of each that all axes share"]]
    plausible: Annotated[bool, "whether the size is in the usual range of the effect"]
    units: NotRequired[Annotated[list[str], "of scope data: the units concerned"]]
    dwells: NotRequired[Annotated[list[int], "of scope data: the dwells concerned"]]
    evidence: NotRequired[Annotated[str, "of scope data: description of the fault"]]
    influence: Annotated[list[InfluentialDwell], "dwells with the largest influence on this class"]
    without_influence: Annotated[WithoutInfluence | None, "the verdict on this class without these dwells"]


class StudentisedDwell(NamedDwell):
    """A dwell and its deviation from the prediction by all other dwells."""

    studentised: Annotated[float | None, "residual over its standard deviation without the dwell"]


class VerdictEvidence(TypedDict):
    """The basis of a verdict."""

    degrees_of_freedom: int
    condition: Annotated[float | None, "of the whitened columns of unit length"]
    bias_jackknife_ug: Annotated[float | None, "jackknife standard deviation of the bias, worst axis, µg"]
    bias_change_ug: Annotated[float | None, "largest change of the bias if one dwell is left out, µg"]
    bias_change_by: Annotated[NamedDwell | None, "the dwell of that change"]
    largest_residual: Annotated[StudentisedDwell | None, "the dwell with the largest deviation"]
    smallest_cubic_ug: Annotated[float | None, "smallest cubic term detected with probability 0.5, µg/g³; null: none"]


class LeaveOut(TypedDict):
    """Single dwells with a fault."""

    dwells: Annotated[list[NamedDwell], "for `--leave-out`"]
    adequate_without: Annotated[bool | None, "the verdict on the other dwells"]


class RemovedDwell(NamedDwell):
    """A dwell that was left out before effects were judged."""

    off_ug: Annotated[float, "distance from the model, µg"]
    deviations: Annotated[float, "the same in standard deviations"]
    tail: NotRequired[Annotated[bool, "whether it is within the tails of the noise, and so no fault"]]


class RemovedDwells(TypedDict):
    """The dwells left out."""

    heavy_tails: Annotated[bool, "the tails of the noise may reach as far as some of the dwells"]
    dwells: list[RemovedDwell]


class UnexplainedExcess(TypedDict):
    """Residual that depends on a quantity, without an effect of the catalogue that explains it."""

    driver: str
    shape: str
    p_value: float
    part: Annotated[
        str, "what depends on the driver: bias, scale, axes (their directions) or transfer (the transfer curve)"
    ]
    text: Annotated[str, "the same as a sentence without a full stop"]
    period_s: Annotated[float | None, "period of an oscillation in time, s; null: another curve"]


class NextMeasurement(TypedDict):
    """A step of the proposed measurement."""

    outer_deg: float
    inner_deg: float
    chamber_C: float
    why: Annotated[str, "effects that it separates, or `not seen so far: …`"]
    wait_s: NotRequired[Annotated[float, "time at rest before the dwell, s"]]
    soaked: NotRequired[Annotated[bool, "false: measured before the temperature has settled"]]
    off_s: NotRequired[Annotated[float, "time with the devices switched off before the step, s"]]
    repeats: NotRequired[Annotated[int, "dwells in a row"]]
    minutes: NotRequired[Annotated[float, "station time of all rows with the same `why`"]]
    separation_before: NotRequired[Annotated[float, "present χ² between the two effects of `why`"]]
    separation_after: NotRequired[
        Annotated[float, "χ² expected after these rows, the smaller for either effect being true"]
    ]
    separation_if: NotRequired[Annotated[dict[str, float], "χ² expected after these rows, by true effect"]]
    not_parted: NotRequired[Annotated[list[str], "effects of the class that these rows do not separate from the best"]]
    measurable: NotRequired[Annotated[bool, "false: no steps; `why` states what is needed"]]


UnseenInPart = TypedDict(
    "UnseenInPart",
    {
        "effect": str,
        "parameter": str,
        "unit": str,
        "from": Annotated[float, "lowest value at which the plan cannot see the effect"],
        "to": float,
        "text": Annotated[str, "the range in words"],
        "breaker": Annotated[str, "measurement that shows it"],
    },
)
"""Parameter values at which this plan does not show an effect that it shows at other values."""


class SmallestNamed(TypedDict):
    """The smallest size of an effect that is detected, RMS over the dwells."""

    effect: str
    size_ug: Annotated[float, "with the noise of this measurement, µg"]
    without_slow_noise_ug: Annotated[float, "with its white part only, µg"]


class SuspectedEffects(TypedDict):
    """The most probable missing effects of a model that fails without a named cause."""

    effects: Annotated[list[str], "best first"]
    p_value: Annotated[float, "probability, over all effects tried, that noise explains as much"]
    named_below: Annotated[float, "probability below which an effect is named"]
    rms_after_ug: Annotated[float, "residual with the first of them, µg"]
    breaker: Annotated[str, "measurement that decides it"]


class SuggestedFormula(TypedDict):
    """A formula for a model file that depends on the unexplained quantity."""

    id: str
    columns: list[str]
    why: str
    toml: Annotated[str, "the formula as text for the model file"]


class DiagnosisDocument(TypedDict):
    """``diagnose --json``: adequacy of a model, where it fails, and which effects are missing."""

    adequate: Annotated[bool | None, "null: cannot be judged, see `reason`"]
    blocked_by: list[BlockingFault]
    error: ErrorFigures
    where: Annotated[list[FailingDriver], "most significant first"]
    classes: Annotated[list[EffectClassDocument], "best first"]
    recommended: Annotated[list[str], "one effect per class; empty if the model is adequate or the cause unknown"]
    unexplained: UnexplainedExcess | None
    unseen: Annotated[list[str], "effects that this plan cannot show"]
    unseen_in_part: list[UnseenInPart]
    smallest_named: Annotated[list[SmallestNamed], "effects hidden most by slow noise first"]
    next_measurements: list[NextMeasurement]
    influence: Annotated[list[InfluentialDwell], "largest share first"]
    suspected: Annotated[SuspectedEffects | None, "null: a cause is named, or noise often explains as much"]
    reason: Annotated[str | None, "why it cannot be judged; null: it can"]
    evidence: VerdictEvidence | None
    leave_out: Annotated[LeaveOut | None, "null: no such dwell"]
    without_influence: Annotated[
        WithoutInfluence | None,
        "the verdict without the dwells of `influence`: on the first class; on the model where nothing is named",
    ]
    removed: RemovedDwells | None
    warnings: list[str]
    effects: Annotated[list[str], "the model that was judged"]
    units: list[str]
    breakers: Annotated[dict[str, str], "per unseen effect, measurement that shows it"]
    reasons: Annotated[dict[str, str], "per unseen effect, the reason why this plan does not show it"]
    offer: SuggestedFormula | None
    history: NotRequired[Annotated[str | None, "file of the temperature history that was read"]]


class UnitComparison(TypedDict):
    """Errors of one unit."""

    rms_ug: float
    fresh_rms_ug: float | None


class PoseComparison(TypedDict):
    """Error of one pose over all units and axes."""

    force: Annotated[list[float], "specific force on x, y, z, g"]
    dwells: int
    rms_ug: float


class StationParameter(TypedDict):
    """A parameter of the station that the fit shares over all units."""

    effect: str
    name: str
    value: float
    standard_error: float


class Confirmation(TypedDict):
    """Evidence of data that were not fitted for the effects that were added to a model."""

    judged_by: Annotated[str, "`fresh run` or `dwells left out`"]
    confirmed: Annotated[bool | None, "null: cannot be decided"]
    part: Annotated[float | None, "share λ of the predicted change that appears in the fresh run"]
    part_u: Annotated[float | None, "standard uncertainty of λ"]
    fall_ug: Annotated[float | None, "decrease of the error, µg"]
    fall_u_ug: Annotated[float | None, "standard uncertainty of the decrease, µg"]
    rises: Annotated[str | None, "the error that rises with the effect; null: none"]
    reason: Annotated[str | None, "why it is not decided; null: it is"]
    estimated_again: Annotated[str | None, "coefficients estimated from the fresh run before it is judged"]
    log_density: Annotated[float | None, "gain in log predictive density of the dwells left out"]


class ComparisonDocument(TypedDict):
    """``compare --json``: error of a model on the run it is fitted to, on poses left out, and on a fresh run."""

    rms_ug: Annotated[float, "residual of the fit, µg"]
    floor_ug: Annotated[float, "noise floor, µg"]
    fresh_rms_ug: Annotated[
        float | None, "error on the fresh run with the coefficients unchanged, µg; null without `--fresh`"
    ]
    by_unit: dict[str, UnitComparison]
    by_pose: Annotated[list[PoseComparison], "worst first; empty if only the norm is known"]
    effects: list[str]
    heldout_rms_ug: Annotated[float | None, "cross-validated error, µg"]
    by_axis: Annotated[dict[str, float], "µg by axis, or `norm` alone"]
    nonlinear: Annotated[dict[str, dict[str, Any]], "estimated parameters by effect"]
    nonlinear_interval: Annotated[dict[str, Any], "68 % interval of each parameter that all axes share"]
    station: list[StationParameter]
    fresh_by_pose: NotRequired[list[PoseComparison]]
    heldout: Annotated[dict[str, float], "cross-validated error by kind of dwells left out, µg"]
    warnings: list[str]
    progress: Annotated[Confirmation | None, "null without a version to compare with"]


class JudgedVersion(TypedDict):
    """The errors of one version of a model, and the verdict on its change."""

    version: int
    added: list[str]
    fitted_ug: Annotated[float | None, "residual of the fit, µg"]
    heldout_ug: Annotated[float | None, "worst cross-validated error of poses, soaks and blocks of time, µg"]
    fresh_ug: Annotated[float | None, "error on the fresh run, µg; null without `--fresh`"]
    fall_ug: Annotated[float | None, "decrease of the error by what was added, µg"]
    fall_u_ug: Annotated[float | None, "standard uncertainty of the decrease, µg"]
    confirmed: Annotated[bool | None, "whether data that were not fitted confirm the change; null: cannot be decided"]
    reason: Annotated[str | None, "why it is not decided; null: it is, or nothing is judged"]
    text: Annotated[str, "`confirmed` as a sentence"]
    warnings: list[str]


class VersionDocument(JudgedVersion):
    """A version of a model; its errors are null without `--dwells`."""

    removed: list[str]
    effects: list[str]
    by: str
    at: Annotated[str, "ISO date and time; empty if the file does not have it"]
    why: str
    run: str
    floor_ug: Annotated[float | None, "noise floor, µg"]


class HistoryDocument(TypedDict):
    """``history --json``: the versions of a model, oldest first, with their errors."""

    model: str
    file: str
    versions: list[VersionDocument]
