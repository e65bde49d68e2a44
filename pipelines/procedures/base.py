"""A test procedure: its part of a recipe, its steps, its reduction to points, its model and figures, its picture."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from schemas.errors import RecipeInvalid
from schemas.recipe import Strict

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.figure import Figure as Drawing

    from schemas.recipe import Pose, Recipe
    from schemas.station import StationConfig

Array = NDArray[np.float64]
REFERENCE = "@reference"
"""The name of the reference sensor in the tables of samples; no serial begins with it."""
StepKind = Literal["dwell", "verification", "allan", "procedure"]


class Part(Strict):
    """The part of a recipe that belongs to one procedure: a table ``[[procedures]]``; ``kind`` names the procedure."""

    kind: Any  # each procedure narrows it to its own name


class NominalScale(Part):
    """A part of a procedure whose figures are in g: the scale comes from the multi-position test, or is stated.

    ``scale`` is the nominal scale, output per g, for lists without a multi-position test before the procedure.
    """

    scale: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] | None = None

    def require_scale(self, recipe: Recipe) -> None:
        """Refuse a recipe that gives no scale; :class:`schemas.errors.RecipeInvalid`."""
        if self.scale is None and not recipe.tumbles:
            raise RecipeInvalid(
                f"recipe: procedure {self.kind} has no scale, output per g is needed for figures in g; set scale, or list "
                "multi_position",
                key="scale",
            )


@dataclass(frozen=True)
class ProcedureStep:
    """One record of a procedure.

    Attributes
    ----------
    name : shown while it is measured
    lasting_s, rate_hz : of the record; None for those of the recipe
    wait_s : after the move; None for the recipe's
    off_s : without power before the move, s
    soak : number of the soak within the procedure, from 0
    role : equipment of the station that performs it; empty for a record on the tilt table
    on_table : the equipment of the role is set first, then the record is taken on the tilt table
    setting : what the equipment is set to, by name with unit
    """

    name: str
    pose: Pose
    temperature_C: float
    kind: StepKind = "procedure"
    lasting_s: float | None = None
    rate_hz: float | None = None
    wait_s: float | None = None
    off_s: float = 0.0
    soak: int = 0
    settled: bool = True
    role: str = ""
    on_table: bool = False
    setting: Mapping[str, float] = field(default_factory=dict[str, float])


@dataclass(frozen=True)
class FigureSpec:
    """A figure that limits may name: its key, unit, and meaning in one line.

    one_axis : the figure is that of a single axis, so that a limit may be a least value; of others the largest axis is kept
    """

    name: str
    unit: str
    meaning: str
    one_axis: bool = False


@dataclass(frozen=True)
class FigureValue:
    """A figure of one unit and axis.

    ``low`` and ``high`` are the ends of a 95 % interval. Where ``identified`` is False the value passes no limit, and ``note``
    states why, and a measurement that determines it.
    """

    figure: str
    axis: str
    value: float
    uncertainty: float
    low: float = float("nan")
    high: float = float("nan")
    identified: bool = True
    note: str = ""


@dataclass(frozen=True)
class Finding:
    """A statement on one unit, or the lot (empty unit): its subject and the text."""

    unit: str
    subject: str
    text: str


@dataclass(frozen=True)
class UnitRecord:
    """The samples of one unit, or of the reference, in one record.

    time : (n,), s on the station's clock; output : (n, 3), unit of the output, or g for the reference
    """

    time: Array
    output: Array

    @property
    def rate_hz(self) -> float:
        """Nominal rate of the samples, Hz."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])


@dataclass(frozen=True)
class ProcedureRecord:
    """One record of a procedure as it was measured: its step, the readings (a row for each unit), and samples by unit."""

    number: int
    step: ProcedureStep
    readings: pd.DataFrame
    samples: Mapping[str, UnitRecord]


@dataclass(frozen=True)
class Device:
    """The units before the procedure: nominal scale from the full scale, and their calibration if there is one.

    scale : (3,) output per g of each axis, by unit; full_scale, out_unit : of the lot
    scale_error : (3,) standard uncertainty of the scale as a share
    """

    scale: Mapping[str, Array]
    scale_error: Mapping[str, Array]
    full_scale: float
    out_unit: str


@dataclass(frozen=True)
class Outcome:
    """The results of a procedure for the units of a lot."""

    figures: Mapping[str, list[FigureValue]]
    findings: Sequence[Finding] = ()


class Procedure(ABC):
    """A test procedure. Each module of this package defines one as PROCEDURE.

    name : of the module, and ``kind`` in recipes · title : heading in the report · order : place in the reference
    roles : equipment that a station must have · source : standard, edition and part · states : its results in one line
    rows : of plots in its picture · from_waveforms : recordings made elsewhere can be imported, one file a record
    reference_unit : of the reference channel of such a recording, g or V
    """

    name: ClassVar[str]
    title: ClassVar[str]
    order: ClassVar[int]
    states: ClassVar[str]
    source: ClassVar[str]
    roles: ClassVar[tuple[str, ...]] = ()
    part: ClassVar[type[Part]]
    figures: ClassVar[tuple[FigureSpec, ...]] = ()
    rows: ClassVar[int] = 1
    from_waveforms: ClassVar[bool] = False
    reference_unit: ClassVar[str] = "g"

    @abstractmethod
    def steps(self, part: Any, recipe: Recipe) -> list[ProcedureStep]:
        """The records of the procedure, in order."""

    def check(self, part: Any, recipe: Recipe, station: StationConfig) -> None:  # noqa: B027 - most have nothing to refuse
        """Refuse what the station cannot perform; :class:`schemas.errors.RecipeInvalid` names the key."""

    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """The recording of a step on the equipment of its role; steps without a role are recorded on the tilt table."""
        raise NotImplementedError

    def prepare(self, equipment: Any, step: ProcedureStep) -> Mapping[str, float]:
        """Sets the equipment of a step with ``on_table``; ``supply_ratio`` of the result is over the nominal supply."""
        raise NotImplementedError

    def setting_of(self, part: Any, reference: UnitRecord) -> dict[str, float]:
        """The setting of a step that was recorded elsewhere, from its reference channel."""
        raise NotImplementedError

    @abstractmethod
    def reduce(self, part: Any, records: Sequence[ProcedureRecord], device: Device) -> pd.DataFrame:
        """Points of the procedure: see the table ``procedure_points``; empty for procedures whose stages reduce elsewhere."""

    @abstractmethod
    def evaluate(self, part: Any, points: pd.DataFrame, device: Device) -> Outcome:
        """Figures and findings of every unit, from the points alone."""

    def draw(self, drawing: Drawing, part: Any, points: pd.DataFrame) -> None:
        """Draw the points of one unit into an empty drawing."""
        raise NotImplementedError


def worst(values: Sequence[FigureValue]) -> FigureValue:
    """The deciding axis: one that is not identified, or no number, else the largest magnitude with twice its uncertainty."""
    missing = [one for one in values if not one.identified]

    def size(one: FigureValue) -> float:
        found = abs(one.value) + 2.0 * one.uncertainty
        return found if np.isfinite(found) else np.inf  # max() passes over a nan that is not the first

    return missing[0] if missing else max(values, key=size)


def scale_of(part: NominalScale, device: Device, unit: str) -> Array:
    """Scale of a unit's axes, (3,), output per g: that of its calibration, else the nominal one of the part."""
    if unit in device.scale:
        return device.scale[unit]
    return np.full(3, np.nan if part.scale is None else part.scale)
