"""A test procedure: its part of a recipe, its steps, its reduction to points, its model and figures, its picture."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Annotated, Any, ClassVar

import numpy as np
import pandas as pd
from pydantic import Field

from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart
from pipelines.procedures.compared import ComparedResult, JudgedCurve
from pipelines.procedures.figures import FigureSpec, FigureValue, Finding, Outcome, Texts, UnitOutcome
from pipelines.procedures.recorded import Array, Device, ProcedureStep, Records, Taken, UnitRecord, point_table, taken
from schemas.errors import RecipeInvalid, did_you_mean
from schemas.recipe import Recipe, Strict
from schemas.station import StationConfig

Celsius = Annotated[float, Field(ge=-100.0, le=200.0)]


class Part(Strict):
    """The part of a recipe that belongs to one procedure: a table ``[[procedures]]``; ``kind`` names the procedure."""

    kind: Any  # each procedure narrows it to its own name


class AtTemperature(Part):
    """A part whose records are taken at one temperature of the chamber."""

    temperature_C: Celsius = 25.0


class NominalScale(AtTemperature):
    """A part of a procedure whose figures are in g: the scale comes from the multi-position test, or is stated.

    ``scale`` is the nominal scale, output per g, for lists without a multi-position test before the procedure.
    """

    scale: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] | None = None


class Procedure(ABC):
    """A test procedure. Each module of this package defines one as PROCEDURE.

    A subclass lists its steps. What else it can do is stated by the classes below that it inherits, each with abstract methods:
    :class:`Evaluated`, :class:`InG`, :class:`OnEquipment`, :class:`SetsEquipment`, :class:`FromWaveforms`, :class:`Compares`.

    Its name is the module's, and ``kind`` in recipes.

    title : heading in the report · order : procedures are listed by it
    roles : equipment that a station must have · source : standard, edition and part · states : its results in one line
    """

    title: ClassVar[str]
    order: ClassVar[int]
    states: ClassVar[str]
    source: ClassVar[str]
    roles: ClassVar[tuple[str, ...]] = ()
    part: ClassVar[type[Part]]
    figures: ClassVar[tuple[FigureSpec, ...]] = ()

    @abstractmethod
    def steps(self, part: Any, recipe: Recipe) -> list[ProcedureStep]:
        """The records of the procedure, in order."""

    def roles_for(self, part: Any) -> tuple[str, ...]:
        """The equipment that a part needs: that of the procedure, or less of it."""
        return self.roles

    def missing_axes(self, part: Any, letters: Sequence[str]) -> list[str]:
        """The axes that a part measures and that a device with these axes lacks: here the axis that the part names."""
        named = [part.axis] if hasattr(part, "axis") else getattr(part, "axes", [])
        return [axis for axis in named if axis not in letters]

    def check(self, part: Any, recipe: Recipe, station: StationConfig) -> None:  # noqa: B027 - most have nothing to refuse
        """Refuse what the station cannot perform; :class:`schemas.errors.RecipeInvalid` names the key."""


class Evaluated(Procedure):
    """A procedure that yields figures from its points; those of others come from the stages ``fit``, ``noise`` and ``grade``."""

    @abstractmethod
    def reduce(self, part: Any, records: Records, device: Device) -> pd.DataFrame:
        """Points of the procedure: see the table ``procedure_points``."""

    @abstractmethod
    def of_unit(self, part: Any, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """Figures of one unit and statements on it, from its points; :class:`NotIdentified` where they give no figure."""

    def of_lot(self, part: Any, points: pd.DataFrame) -> Texts:
        """Statements on the lot."""
        return []

    @abstractmethod
    def chart(self, part: Any, points: pd.DataFrame) -> Chart | None:
        """The points of one unit with what was fitted to them; None where they are too few."""

    def evaluate(self, part: Any, points: pd.DataFrame, device: Device) -> Outcome:
        """Figures and findings of every unit, from the points alone."""
        figures: dict[str, list[FigureValue]] = {}
        findings: list[Finding] = []
        results: dict[str, list[ComparedResult]] = {}
        curves: dict[str, list[JudgedCurve]] = {}
        for name, rows in points.groupby("unit", sort=False):
            unit = str(name)
            try:
                figures[unit], texts = self.of_unit(part, unit, rows, device)
            except NotIdentified as problem:
                measured = rows["axis"].unique()
                axis = str(measured[0]) if len(measured) == 1 else ""
                figures[unit], texts = self.nothing(part, str(problem), axis), []
            else:
                if isinstance(self, Compares):
                    values = {figure.figure: figure for figure in figures[unit] if figure.identified}
                    results[unit], curves[unit] = self.compared(part, rows, values, device.out_unit)
            findings += [Finding(unit, *text) for text in texts]
        findings += [Finding("", *text) for text in self.of_lot(part, points)]
        return Outcome(figures, findings, results, curves)

    def nothing(self, part: Any, note: str, axis: str = "") -> list[FigureValue]:
        """Every figure without a value, with the reason; for no axis in particular the part's, or all."""
        axis = axis or getattr(part, "axis", "*")
        return [FigureValue.not_determined(spec.name, axis, note) for spec in self.figures]


class RecordByRecord(Evaluated):
    """A procedure whose records are reduced independently of each other."""

    def reduce(self, part: Any, records: Records, device: Device) -> pd.DataFrame:
        """The points of every unit in every record."""
        return point_table(row for measured in taken(records) for row in self.points(part, measured, device))

    @abstractmethod
    def points(self, part: Any, taken: Taken, device: Device) -> Iterable[Mapping[str, Any]]:
        """The points of one unit in one record."""


class InG(Procedure):
    """A procedure whose figures are in g: a recipe without a scale is refused. Its part is a :class:`NominalScale`."""

    def check(self, part: NominalScale, recipe: Recipe, station: StationConfig) -> None:
        """Refuse a list without a scale."""
        if part.scale is None and not recipe.tumbles:
            raise RecipeInvalid(
                f"recipe: procedure {part.kind} has no scale, output per g is needed for figures in g; set scale, or list "
                "multi_position",
                key="scale",
            )


class OnEquipment(Procedure):
    """A procedure with steps that are recorded on the equipment of their role, not on the tilt table."""

    @abstractmethod
    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """The recording of a step with a role."""


class SetsEquipment(Procedure):
    """A procedure with steps ``on_table``: equipment is set, then the record is taken on the tilt table."""

    @abstractmethod
    def set_equipment(self, equipment: Any, step: ProcedureStep) -> Mapping[str, float]:
        """Set the equipment of the role; ``supply_ratio`` of the result is over the nominal supply."""


class Compares(Evaluated):
    """A procedure whose results are by comparison with a reference sensor: they have a budget, and can be certified.

    The first of its roles names the comparison in ``[uncertainty]``.
    """

    @abstractmethod
    def compared(
        self, part: Any, rows: pd.DataFrame, figures: Mapping[str, FigureValue], out_unit: str
    ) -> tuple[list[ComparedResult], list[JudgedCurve]]:
        """The results of one unit from its points and its figures that are determined, and the models that they rest on."""


class FromWaveforms(Evaluated):
    """A procedure whose recordings may be made elsewhere and imported, one file a record.

    reference_unit : of the reference channel of such a recording, g or V
    needs_reference : whether it gives no figure without a recorded reference
    """

    reference_unit: ClassVar[str] = "g"
    needs_reference: ClassVar[bool] = True

    def completed(self, part: Any, references: Sequence[UnitRecord]) -> Any:
        """The part with what recordings made elsewhere show and the user has not stated."""
        return part

    def verdict(self, part: Any, rows: pd.DataFrame) -> str:
        """Verdict on the model of one unit's points, of :data:`schemas.tables.VERDICTS`; empty where they have no model."""
        return ""

    @abstractmethod
    def setting_of(self, part: Any, reference: UnitRecord) -> dict[str, float]:
        """The setting of a step that was recorded elsewhere, from its reference channel."""


def refuse_broken_turn(step_deg: float, fewest: int, advice: str) -> None:
    """Refuse steps that give no whole number of angles in a turn, or too few; ValueError, for validators of parts."""
    count = 360.0 / step_deg
    if abs(count - round(count)) > 1e-9 or round(count) < fewest:
        raise ValueError(
            f"step_deg: {step_deg:g}° gives {count:g} angles in a turn, a whole number of at least {fewest} is needed{advice}"
        )


def refuse_unknown_effects(names: Sequence[str], known: Collection[str], test: str) -> None:
    """Refuse effects that the catalogue of a test does not have; ValueError, for validators of parts."""
    for name in names:
        if name not in known:
            raise ValueError(f"effects: no effect '{name}' of {test}; {did_you_mean(name, known)}")


def scale_of(part: NominalScale, device: Device, unit: str) -> Array:
    """Scale of a unit's axes, (3,), output per g: that of its calibration, else the nominal scale of the part."""
    if unit in device.scale:
        return device.scale[unit]
    return np.full(3, np.nan if part.scale is None else part.scale)
