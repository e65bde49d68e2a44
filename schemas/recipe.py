"""The recipe of a calibration: what is measured, how long, where, and which model and limits are applied to it.

The file is TOML and its keys are the fields of :class:`RecipeFile`. Poses may be named there; :class:`Recipe` is the
same thing with every name resolved, and is what stages and stations are given.
"""

from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, FiniteFloat, field_validator, model_validator

from schemas.bounds import (
    LONGEST_RUN_S,
    MOST_POSES,
    MOST_SOAKS,
    MOST_UNITS,
    Celsius,
    Degrees,
    Name,
    NotNegative,
    Number,
    Positive,
    Rate,
    Seconds,
    Seed,
    Text,
    Wait,
)
from schemas.fault import FaultOrder
from schemas.foreign import shown
from schemas.poses import Pose, SoakPart
from schemas.prior import PriorTerms
from schemas.stopping import StopTerms
from schemas.strict import Grown, Strict, refuse_repeated
from schemas.uncertainty import Uncertainty
from schemas.validity import CertificateTerms, Stability

SHORTEST_SOAK_S = 900.0  # at least 15 min of soak per temperature: the field's practice for static tests at ±1 °C
FEWEST_SAMPLES = 100  # per pose
LEAST_SPAN_G = 1.4  # of the poses on every axis; twelve edges reach 1.41, and a scale from less is an extrapolation

MOST_PROCEDURES = 50  # in one recipe
MOST_SAMPLES = 10**9  # of one record, on one axis


def _refuse_other_than_two(value: Any) -> Any:
    if isinstance(value, list | tuple) and len(value) != 2:
        raise ValueError(
            f"found {shown(value)}: the two angles [outer, inner] of a pose, in degrees, are needed; correct them"
        )
    return value


Angles = Annotated[list[Degrees], Field(min_length=2, max_length=2), BeforeValidator(_refuse_other_than_two)]
Gravity = Annotated[FiniteFloat, Field(gt=9.7, lt=9.9)]  # every place on earth lies between 9.76 and 9.84 m/s²


class _Measurement(Grown):
    """The keys that a recipe file and a resolved recipe share.

    ``sensor_axes`` is the number of axes with an output: x alone, x and y, or all three.
    ``zero_output`` is the nominal output at 0 g, in the output's unit; the zero-g offset is counted from it.
    ``soaks`` say soak by soak which poses are measured; ``temperatures_C`` are theirs then and may be left out.
    ``span_min_g`` is how far the poses must reach on every axis, largest minus smallest. ``faults`` are trouble for a
    simulated station, to try what a recipe does then. ``verification_order``: at the end of each soak, or spread among the poses
    of the fit; it is part of the recipe because it moves the figure of verification. ``uncertainty`` states what the recipe's own
    fixture adds to the station's, ``stability`` what this kind of device does beyond a run, ``certificate`` what is certified.
    ``prior`` names earlier calibrations of the device that count beside the measurement, ``stop`` what ends the lot early.
    ``procedures`` lists the test procedures of the lot in order; without it
    the lot goes through the multi-position test and the static record.
    """

    later: ClassVar[frozenset[str]] = frozenset(
        {"sensor_axes", "verification_order", "uncertainty", "stability", "certificate", "procedures", "prior", "stop"}
    )

    name: Annotated[Name, Field(pattern=r"^[a-z0-9][a-z0-9._-]*$")]
    description: Text = ""
    device: Name
    sensor_axes: Annotated[int, Field(ge=1, le=3)] = 3
    local_gravity_m_s2: Gravity
    temperatures_C: Annotated[list[Celsius], Field(min_length=1, max_length=MOST_SOAKS)]
    soaks: Annotated[list[SoakPart], Field(max_length=MOST_SOAKS)] = []
    soak_min_s: Seconds = SHORTEST_SOAK_S
    allow_short_soak: bool = False
    settle_s: Wait = 2.0
    dwell_s: Seconds = 10.0
    rate_hz: Rate = 100.0
    static_record_s: Wait = 0.0
    static_temperature_C: Celsius = 25.0
    zero_output: Number = 0.0
    span_min_g: Positive = LEAST_SPAN_G
    effects: Annotated[list[str], Field(max_length=1000)] = []
    limits: str = "consumer"
    units: Annotated[list[str], Field(max_length=MOST_UNITS)] = []
    seed: Seed = 0
    faults: list[FaultOrder] = []
    procedures: Annotated[list[dict[str, Any]], Field(max_length=MOST_PROCEDURES)] = []
    verification_order: Literal["last", "interleaved"] = "last"
    uncertainty: Uncertainty | None = None
    stability: Stability | None = None
    certificate: CertificateTerms | None = None
    prior: PriorTerms | None = None
    stop: StopTerms | None = None

    @property
    def tumbles(self) -> bool:
        """Whether the lot goes through the multi-position test: always, unless a list of procedures leaves it out."""
        return not self.procedures or any(part.get("kind") == "multi_position" for part in self.procedures)

    @model_validator(mode="before")
    @classmethod
    def _temperatures_of_the_soaks(cls, given: Any) -> Any:
        if not isinstance(given, dict) or not given.get("soaks") or "temperatures_C" in given:
            return given
        parts = given["soaks"]
        if not isinstance(parts, list) or not all(isinstance(s, dict | SoakPart) for s in parts):
            return given  # the field itself says what is wrong
        temperatures = [s.get("temperature_C") if isinstance(s, dict) else s.temperature_C for s in parts]
        return {**given, "temperatures_C": temperatures}

    @model_validator(mode="after")
    def _usable(self) -> "_Measurement":
        if self.soak_min_s < SHORTEST_SOAK_S and not self.allow_short_soak:
            raise ValueError(
                f"soak_min_s: {self.soak_min_s:g} s, the recipe needs {SHORTEST_SOAK_S:g} s; soak longer, or set "
                "allow_short_soak = true and answer for the temperature gradients"
            )
        if self.soaks and [s.temperature_C for s in self.soaks] != self.temperatures_C:
            raise ValueError(
                "soaks, temperatures_C: they say different temperatures, one of the two is enough; remove temperatures_C"
            )
        samples = int(self.dwell_s * self.rate_hz)
        if samples < FEWEST_SAMPLES:
            raise ValueError(
                f"dwell_s: {samples} samples per pose, a mean needs {FEWEST_SAMPLES}; raise dwell_s or rate_hz"
            )
        for key in ("dwell_s", "static_record_s"):
            if getattr(self, key) * self.rate_hz > MOST_SAMPLES:
                raise ValueError(
                    f"{key}: {getattr(self, key) * self.rate_hz:.3g} samples in one record, at most {MOST_SAMPLES:.0e} are "
                    f"possible; lower {key} or rate_hz"
                )
        return self

    @model_validator(mode="after")
    def _stops_by_its_model(self) -> "_Measurement":
        missing = [effect for effect in (self.stop.asked if self.stop else ()) if effect not in self.effects]
        if missing and self.effects:
            raise ValueError(
                f"stop: an uncertainty of {missing[0]} is asked for, the model has no such effect; remove it, or add the effect"
            )
        return self

    @field_validator("temperatures_C")
    @classmethod
    def _no_soak_twice_in_a_row(cls, values: list[float]) -> list[float]:
        again = sorted({f"{a:g}" for a, b in pairwise(values) if a == b})
        if again:
            raise ValueError(
                f"{', '.join(again)} °C is there twice in a row, a soak goes to another temperature; remove the second"
            )
        return values

    @field_validator("procedures", mode="before")
    @classmethod
    def _each_in_a_table(cls, values: Any) -> Any:
        if isinstance(values, list) and (names := [value for value in values if isinstance(value, str)]):
            raise ValueError(
                f"'{shown(names[0])}' is a name, a table for each procedure is needed; write [[procedures]], and below it "
                f'kind = "{shown(names[0])}"'
            )
        return values

    @field_validator("effects", "units")
    @classmethod
    def _no_repeats(cls, values: list[Any]) -> list[Any]:
        refuse_repeated(values, "", "remove the second")
        return values


class FormulaSpec(Strict):
    """An effect written as formulas, one per column; :mod:`inertial.expressions` says what may stand in them."""

    id: Annotated[Name, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    columns: Annotated[list[Annotated[str, Field(min_length=1, max_length=1000)]], Field(min_length=1, max_length=12)]
    why: Text = ""
    symbol: Name = "c"
    typical_ug: tuple[NotNegative, NotNegative] = (1.0, 10000.0)


class RecipeFile(_Measurement):
    """A recipe as it stands in its file: poses by the name of a plan, or as [outer, inner] in degrees.

    ``verification_repeats`` is how often the verification poses are gone through at every temperature: the mean of a pose's
    dwells tells what the calibration leaves, one dwell alone what the device has wandered besides.
    """

    poses: str | Annotated[list[Angles], Field(max_length=MOST_POSES)] = []
    verification: str | Annotated[list[Angles], Field(max_length=MOST_POSES)] = []
    verification_repeats: Annotated[int, Field(ge=1, le=20)] = 1
    static_pose: Angles = [0.0, 0.0]
    model: str = ""

    @model_validator(mode="after")
    def _one_model(self) -> "RecipeFile":
        if not self.tumbles:
            return self
        if not self.poses:
            raise ValueError("key 'poses' is missing; add it")
        if bool(self.model) == bool(self.effects):
            raise ValueError("effects, model: one of the two is needed; list the effects, or name a model file")
        return self


class Recipe(_Measurement):
    """A recipe with every name resolved: what capture and the stages work from."""

    poses: list[Pose]
    verification: list[Pose] = []
    static_pose: Pose
    model_name: str = ""
    model_version: int = 0
    formulas: list[FormulaSpec] = []

    @model_validator(mode="after")
    def _soaks_name_poses_that_are_there(self) -> "Recipe":
        for number, part in enumerate(self.soaks, start=1):
            for key, listed in (("poses", self.poses), ("verification", self.verification)):
                beyond = [k for k in getattr(part, key) or [] if k > len(listed)]
                if beyond:
                    raise ValueError(
                        f"soaks: soak {number} names {key} {beyond[0]}, there are {len(listed)}; correct the number"
                    )
            for key, what in (("waits_s", "waits"), ("off_s", "times without power")):
                given, count = getattr(part, key), len(self.poses_at(number - 1))
                if given is not None and len(given) != count:
                    raise ValueError(
                        f"soaks: soak {number} has {len(given)} {what} for {count} poses, each pose needs one; "
                        f"correct {key}"
                    )
        return self

    @property
    def _dwells(self) -> int:
        return sum(len(self.poses_at(k)) + len(self.verification_at(k)) for k in range(len(self.temperatures_C)))

    @model_validator(mode="after")
    def _comes_to_an_end(self) -> "Recipe":
        soaks, dwells = range(len(self.temperatures_C)), self._dwells
        waits = sum(
            sum(self.waits_at(k)) + sum(self.off_at(k)) + self.settle_s * len(self.verification_at(k)) for k in soaks
        )
        total = len(soaks) * self.soak_min_s + dwells * self.dwell_s + waits + self.static_record_s
        if total > LONGEST_RUN_S:
            raise ValueError(
                f"soak_min_s, settle_s, dwell_s: {len(soaks)} soaks and {dwells} dwells take {total / 86400.0:.4g} days, at most "
                f"{LONGEST_RUN_S / 86400.0:g} are possible; shorten them"
            )
        return self

    def waits_at(self, soak: int) -> list[float]:
        """Waits after the move to each of the poses of a soak, from 0, s."""
        waits = self.soaks[soak].waits_s if self.soaks else None
        return [self.settle_s] * len(self.poses_at(soak)) if waits is None else waits

    def off_at(self, soak: int) -> list[float]:
        """Seconds without power before the move to each of the poses of a soak, from 0."""
        off = self.soaks[soak].off_s if self.soaks else None
        return [0.0] * len(self.poses_at(soak)) if off is None else off

    def settles_at(self, soak: int) -> bool:
        """Whether the devices settle at a soak, from 0, before its dwells begin."""
        return self.soaks[soak].settled if self.soaks else True

    def poses_at(self, soak: int) -> list[Pose]:
        """The poses of the fit that are measured at a soak, from 0, in order."""
        return _picked(self.poses, self.soaks[soak].poses if self.soaks else None)

    def verification_at(self, soak: int) -> list[Pose]:
        """The poses for verification that are measured at a soak, from 0, in order."""
        return _picked(self.verification, self.soaks[soak].verification if self.soaks else None)

    @model_validator(mode="after")
    def _tumbles_in_poses(self) -> "Recipe":
        if self.tumbles and not self.poses:
            raise ValueError("poses: none, the multi-position test needs at least 1; add poses")
        return self

    @property
    def planned_records(self) -> int:
        """The number of records that capture makes: the poses of every soak, and the static one."""
        return self._dwells + (1 if self.static_record_s > 0.0 else 0)


def _picked(poses: list[Pose], numbers: list[int] | None) -> list[Pose]:
    """The poses of these numbers, from 1; all where none are given."""
    return poses if numbers is None else [poses[k - 1] for k in numbers]
