"""``[uncertainty]`` of a station's file or a recipe: what the references of a calibration are worth, entry by entry.

Each entry states a standard uncertainty u, or an expanded one U with its k, or a half-width with its distribution; the unit
stands in the key (``u_urad``, ``U_K``, ``half_width_arcsec``). It names the reference standard, or another source.
"""

import math
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from schemas.bounds import Degrees, NotNegative, Number, Positive
from schemas.comparison import Comparison, ExciterBand
from schemas.stated import TO_SI, AngleEntry, Entry, RelativeEntry, Scope, StandardUncertainty, Stated
from schemas.strict import Strict
from schemas.units import STANDARD_GRAVITY_M_S2

__all__ = ["NEEDED", "TO_SI", "Entry", "StandardUncertainty", "Uncertainty", "formula_gravity"]

FREE_AIR = -3.086e-6
"""m/s² per m of height."""


def formula_gravity(latitude_deg: float, height_m: float = 0.0) -> float:
    """Normal gravity at a latitude with the free-air reduction, m/s² (Moritz 1980, GRS 1980)."""
    square = math.sin(math.radians(latitude_deg)) ** 2
    normal = 9.7803267715 * (1.0 + 0.001931851353 * square) / math.sqrt(1.0 - 0.0066943800229 * square)
    return normal + FREE_AIR * height_m


class Harmonics(AngleEntry):
    """Errors of the encoders that come again with every turn: u of each sine and cosine of the orders."""

    orders: Annotated[list[Annotated[int, Field(ge=1, le=12)]], Field(min_length=1)] = [1, 2]
    axes: Annotated[list[Literal["outer", "inner"]], Field(min_length=1)] = ["outer", "inner"]


class PoseEntry(AngleEntry):
    """Error of a pose, of each axis: drawn anew at each approach; with scope ``station`` or ``run`` once for each pose."""

    scope: Scope = "pose"
    seen_in_residuals: bool = False


class Gravity(RelativeEntry):
    """Local gravity: surveyed, or by the formula of 1980 from latitude and height (standard uncertainty 60 ppm)."""

    value_m_s2: Annotated[Number, Field(gt=9.7, lt=9.9)] | None = None
    latitude_deg: Annotated[Degrees, Field(ge=-90.0, le=90.0)] | None = None
    height_m: Annotated[Number, Field(ge=-500.0, le=9000.0)] | None = None
    source: Literal["survey", "formula"] = "survey"  # pyright: ignore[reportIncompatibleVariableOverride] - frozen
    standard_gravity_meant: bool = False
    u_m_s2: Stated = None
    U_m_s2: Stated = None

    @property
    def value(self) -> float:
        """Local gravity, m/s²."""
        if self.value_m_s2 is not None:
            return self.value_m_s2
        return formula_gravity(self.latitude_deg or 0.0, self.height_m or 0.0)

    def relative(self) -> StandardUncertainty:
        """Relative standard uncertainty; 60 ppm of the formula where none is stated."""
        standard = self.standard()
        if standard.unit == "m_s2":
            return standard._replace(u=standard.u / self.value)
        if not standard.unit and not self.exact:
            return StandardUncertainty(60e-6, "ppm", 60.0, "normal", 1.0)
        return standard

    def states(self, part: str = "") -> bool:
        """Whether the entry has an uncertainty, that of the formula where none is stated, or is said to be exact."""
        return self.exact or self.relative().u > 0.0

    @property
    def origin(self) -> str:
        """Survey, or the formula."""
        return "GRS 1980 formula with free-air reduction" if self.source == "formula" else ""

    @property
    def _needs_value(self) -> bool:
        return self.source != "formula"

    @model_validator(mode="after")
    def _placed(self) -> "Gravity":
        if self.source == "formula" and (self.latitude_deg is None or self.height_m is None):
            raise ValueError('latitude_deg, height_m: needed with source = "formula"; add both')
        if self.source == "survey" and self.value_m_s2 is None:
            raise ValueError(
                'value_m_s2: missing; state it as surveyed, or latitude_deg and height_m with source = "formula"'
            )
        if self.value_m_s2 == STANDARD_GRAVITY_M_S2 and not self.standard_gravity_meant and not self.exact:
            raise ValueError(
                "value_m_s2: 9.80665 is standard gravity, not a site's value, and off by up to 2700 ppm; state it as surveyed, "
                "give latitude_deg and height_m, or confirm it with standard_gravity_meant = true"
            )
        if self.value_m_s2 is not None and self.latitude_deg is not None and self.height_m is not None:
            apart = self.value_m_s2 / formula_gravity(self.latitude_deg, self.height_m) - 1.0
            if abs(apart) > 300e-6:
                raise ValueError(
                    f"value_m_s2: {self.value_m_s2:g} m/s² and the formula differ by {1e6 * apart:.0f} ppm, at most 300 are "
                    "plausible; correct the value, the latitude or the height"
                )
        return self


class Thermometer(Entry):
    """The thermometer of the calibration: offset, slope, scatter from soak to soak, and whose temperature it measures."""

    measures: Literal["device", "slot", "chamber"]
    offset_u_K: Stated = None
    offset_U_K: Stated = None
    offset_half_width_K: Stated = None
    slope_u_percent: Stated = None
    slope_U_percent: Stated = None
    slope_half_width_percent: Stated = None
    soak_u_K: Stated = None


class TemperatureEntry(Entry):
    """A temperature difference."""

    u_K: Stated = None
    U_K: Stated = None
    half_width_K: Stated = None


class Settling(Entry):
    """What remains of a step of temperature after the soak, by the time constants of the slots."""

    tau_s: Annotated[list[Positive], Field(min_length=1, max_length=64)]
    scope: Scope = "run"

    def states(self, part: str = "") -> bool:
        """Whether the entry is stated, by its time constants."""
        return True

    @property
    def _needs_value(self) -> bool:
        return False


class Supply(RelativeEntry):
    """Supply of a device whose output follows it, or, where each slot's is measured and divided out, that ratio.

    A reader whose converter is referred to the device's supply measures the ratio as well.
    """

    ratio_measured: bool = False
    scope: Scope = "run"


class Reader(Entry):
    """Converter and amplifier: gain, offset, integral nonlinearity."""

    rectangular: ClassVar[str] = "inl_half_width_ug"

    scope: Scope = "slot"
    gain_u_ppm: Stated = None
    gain_U_ppm: Stated = None
    offset_u_ug: Stated = None
    offset_U_ug: Stated = None
    inl_half_width_ug: Stated = None


class Timing(Entry):
    """Time between the reading of a temperature and that of the output, and the creep after a move."""

    rectangular: ClassVar[str] = "creep_half_width_ug"

    scope: Scope = "run"
    wait_u_s: Stated = None
    creep_half_width_ug: Stated = None


class Vibration(Entry):
    """Vibration of the fixture, which the device rectifies."""

    scope: Scope = "run"
    rms_u_g: Stated = None
    coefficient_ug_g2: NotNegative = 0.0


class Uncertainty(Strict):
    """The table ``[uncertainty]``.

    grade_source : what the figures rest on; with ``assumed`` nothing is certified
    exciter : by bands of frequency; shock_machine : of both kinds of equipment that compare with a reference sensor
    """

    grade_source: Literal["certificates", "data_sheet", "assumed"] = "assumed"
    gravity: Gravity | None = None
    level: AngleEntry | None = None
    orthogonality: AngleEntry | None = None
    outer_offset: AngleEntry | None = None
    inner_offset: AngleEntry | None = None
    harmonics: Harmonics | None = None
    pose: PoseEntry | None = None
    seat: AngleEntry | None = None
    thermometer: Thermometer | None = None
    gradient: TemperatureEntry | None = None
    settling: Settling | None = None
    supply: Supply | None = None
    reader: Reader | None = None
    timing: Timing | None = None
    vibration: Vibration | None = None
    exciter: Annotated[list[ExciterBand], Field(max_length=16)] = Field(default_factory=list[ExciterBand])
    shock_machine: Comparison | None = None

    @property
    def entries(self) -> dict[str, Entry]:
        """The entries of the static calibration that are stated, by name."""
        entries = {name: getattr(self, name) for name in OF_STATIC}
        return {name: entry for name, entry in entries.items() if entry is not None}

    @property
    def every_entry(self) -> dict[str, Entry]:
        """The entries that are stated, those of comparisons as well, by the path of their key."""
        compared: dict[str, Comparison] = {f"exciter[{number}]": band for number, band in enumerate(self.exciter)}
        if self.shock_machine is not None:
            compared["shock_machine"] = self.shock_machine
        by_path = {
            f"{path}.{name}": entry
            for path, comparison in compared.items()
            for name, entry in comparison.entries.items()
        }
        return {**self.entries, **by_path}

    def comparison(self, role: str, frequency_hz: float) -> Comparison | None:
        """What is stated of the equipment of a role at a frequency; the first one for NaN (no single frequency)."""
        if role != "exciter":
            return self.shock_machine if role == "shock_machine" else None
        anywhere = math.isnan(frequency_hz)
        return next((band for band in self.exciter if anywhere or band.from_hz <= frequency_hz <= band.to_hz), None)

    @property
    def not_stated(self) -> dict[str, str]:
        """Entries that are missing, and parts of entries that are missing or 0 without ``exact``, with what they rule."""
        missing: dict[str, str] = {}
        for name, rules in NEEDED.items():
            entry = getattr(self, name)
            if entry is None:
                missing[name] = rules
            else:
                gaps = [part for part in PARTS.get(name, ("",)) if not entry.states(part)]
                missing |= {f"{name} {part}".strip(): rules for part in gaps}
        return missing

    @model_serializer(mode="wrap")
    def _only_stated(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {name: value for name, value in handler(self).items() if value is not None and value != []}


OF_STATIC = tuple(name for name in Uncertainty.model_fields if name not in {"grade_source", "exciter", "shock_machine"})
"""The entries of the static calibration."""
NEEDED = {
    "gravity": "scale", "level": "bias and misalignment", "orthogonality": "bias and misalignment", "outer_offset": "bias of z",
    "inner_offset": "misalignment", "harmonics": "scale", "pose": "scatter of the poses", "seat": "misalignment",
    "thermometer": "temperature coefficients", "gradient": "bias and scale over temperature",
    "settling": "temperature coefficients", "supply": "scale", "reader": "scale and bias",
}  # fmt: skip
"""Entries that a whole budget has, with the coefficients that each rules."""
PARTS = {"thermometer": ("offset", "slope"), "reader": ("gain", "offset")}
"""Parts that such an entry has."""
