"""The JSON documents of discover and attributes: keys that other programs read. A NotRequired key may be missing."""

from typing import Annotated, Any, Literal, NotRequired

from typing_extensions import TypedDict

Scope = Literal["sensor", "station", "sensor_or_station", "thermometer"]


class LeftOutRun(TypedDict):
    """A run that is not pooled."""

    run: str
    reason: str


PooledLots = TypedDict(
    "PooledLots",
    {
        "lots": int,
        "units": Annotated[int, "measurements of units"],
        "left_out": list[LeftOutRun],
        "from": Annotated[str | None, "day of the first lot"],
        "until": Annotated[str | None, "day of the last lot"],
    },
)


class ErrorControl(TypedDict):
    """The threshold of a discovery."""

    alpha: Annotated[float, "probability that an archive without any hidden effect ever shows a discovery"]
    hypotheses: int
    log_e_needed: Annotated[float | None, "natural logarithm of the evidence; null: no lot can be used"]
    valid: Annotated[str, "when the evidence may be evaluated: every night"]


class DiscoveredLevel(TypedDict):
    """One level of a driver."""

    level: str
    size_ug: Annotated[float, "signed, on the axis"]
    u_ug: Annotated[float, "one standard error"]
    units: int
    axis: Annotated[str, "the axis with the largest differences; empty: of the force on all axes"]


class CarriedBy(TypedDict):
    """How the lots share the evidence."""

    lots_for: Annotated[float | None, "share of the lots that support it; null: an error of the station"]
    log_e_without_largest_2_percent: float | None


class DiscoveryRow(TypedDict):
    """One discovery."""

    id: str
    since: Annotated[str, "day of the first night on which it was beyond the threshold"]
    lots_then: int
    effects: Annotated[list[str], "class of effects that the lots cannot separate, best first"]
    recommended: str
    axes: list[str]
    driver: str
    drivers: Annotated[list[str], "class of drivers, best first"]
    kind: Literal["mean", "levels", "slope"]
    size_ug: Annotated[float, "rms over levels and axes in a dwell"]
    interval_ug: Annotated[list[float], "95 %"]
    size_floors: Annotated[float | None, "the same over the noise of a dwell of one lot"]
    log_e: float
    scope: Scope
    because: str
    levels: list[DiscoveredLevel]
    carried_by: CarriedBy
    confirmed: Annotated[bool | None, "whether later lots show what earlier ones predict; null: fewer than 20 of them"]
    confirmed_factor: NotRequired[Annotated[list[float], "later over predicted, and its standard error"]]
    next: str


class HeldAlarm(TypedDict):
    """Evidence that may be the station's own wander: it is no discovery."""

    effect: str
    axis: str
    driver: str
    log_e: float
    reason: str


class UnexplainedRow(TypedDict):
    """Evidence by a driver that no effect of the catalogue accounts for: a discovery without a name."""

    id: Annotated[str, "as of a discovery, which keeps it if an effect is identified later"]
    since: Annotated[str, "day of the first night on which it was beyond the threshold"]
    lots_then: int
    driver: str
    level: Annotated[str, "level of the driver that the map shows, the one with most; empty: the driver has none"]
    axes: list[str]
    map: Annotated[list[list[float]], "outer, inner angle in degrees, size, its standard error in µg; may be empty"]
    log_e: float
    nearest: Annotated[str, "the effect with the largest evidence"]


class PopulationRow(TypedDict):
    """A finding on coefficients of many units."""

    figure: str
    kind: Literal["two_populations", "correlation"]
    log_e: float
    detail: dict[str, Any]


class ReachRow(TypedDict):
    """The smallest effect that the archive would have shown."""

    effect: str
    driver: Annotated[str, "mean, or inside lots"]
    smallest_ug: float
    lots_to_1_ug: int | None


class UntoldEffect(TypedDict):
    """An effect that no lot can separate from errors of the station."""

    effect: str
    reason: str


class DriverRow(TypedDict):
    """A driver that was judged, or why it was not."""

    name: str
    status: str


class ComparedAlarm(TypedDict):
    """A discovery before and after an effect is in the model of every lot."""

    id: str
    recommended: str
    driver: str
    log_e_before: float
    log_e_after: float
    size_ug_before: float
    size_ug_after: float


class DiscoverDocument(TypedDict):
    """``discover --json``: the effects that the lots of an archive show together."""

    pooled: PooledLots
    model: list[str]
    device: str
    error_control: ErrorControl
    discoveries: list[DiscoveryRow]
    held: list[HeldAlarm]
    unexplained: Annotated[list[UnexplainedRow], "evidence that no effect of the catalogue accounts for"]
    population: Annotated[list[PopulationRow], "with --populations"]
    reach: list[ReachRow]
    unseen: list[UntoldEffect]
    drivers: list[DriverRow]
    warnings: list[str]
    compared: Annotated[list[ComparedAlarm], "with --model: discoveries of the sensors"]
    new: Annotated[list[str], "ids of discoveries and unexplained dependences that are new since the last evaluation"]
    looking_back: bool


class ExplainedDiscovery(DiscoveryRow):
    """``discover --explain ID --json``: one discovery."""


class ExplainedRemainder(UnexplainedRow):
    """``discover --json --explain ID``: one that no effect of the catalogue accounts for."""


class AddedAttributes(TypedDict):
    """``attributes add --json``: what was added."""

    added: Annotated[int, "values that are new"]
    changed: Annotated[int, "values that replace another one; the old one is kept"]
    unchanged: int
    by: Annotated[str, "serial or run"]
    names: Annotated[list[str], "of the attributes"]
    unknown: Annotated[list[str], "serials or runs that the archive does not have yet"]
    similar: Annotated[dict[str, list[str]], "of the first five unknown ones, those of the archive that are similar"]
    refused: Annotated[list[str], "columns that follow from the result of a calibration, and were not taken"]
    future: Annotated[list[str], "dates after today, with attribute and key"]
    quantities: Annotated[list[str], "attributes that are judged as numbers or days; the others are labels"]
    file: Annotated[str, "where they are kept, in the archive"]


class KnownAttribute(TypedDict):
    """One attribute."""

    attribute: str
    of: Annotated[str, "units or runs"]
    known: Annotated[int, "of how many"]
    levels: int
    judged_as: Annotated[str, "quantity or labels"]
    such_as: str


class ListedAttributes(TypedDict):
    """``attributes list --json``: what is known of units and runs."""

    attributes: list[KnownAttribute]


class HiddenInWafer(TypedDict):
    """The effect that a demonstration hid."""

    wafer: str
    physics: str
    effect: str


class DiscoveryDemo(TypedDict):
    """``demo --lots N --json``: what was hidden in an archive of many lots, and what was found of it."""

    seed: int
    hidden: HiddenInWafer
    discoveries: list[DiscoveryRow]
    found: bool
    wafer_named: Annotated[bool, "whether the wafer that differs most is the hidden one"]
    compared: list[ComparedAlarm]
    left: Annotated[list[str], "discoveries that are left with the effect in the model of every lot"]
    folder: str
    lots: int
