"""The meaning of the columns of a foreign file: from the command line or a TOML file, checked before the file is read."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal
from zoneinfo import available_timezones

import pandas as pd
from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator, model_validator

from inertial.quantities import FORCE_COLUMNS, LARGEST, OUTPUT_COLUMNS, RECORDED, SLOW_COLUMNS, SPREAD_COLUMNS
from schemas.bounds import FASTEST_HZ, LONGEST_WAIT_S
from schemas.errors import RecipeInvalid, WrongUse, close_matches, did_you_mean
from schemas.foreign import shown
from schemas.toml_files import parse_toml, read_text
from schemas.units import STANDARD_GRAVITY_M_S2

NEEDED = ("x", "y", "z")
TILT = "tilt_deg"
"""Angle of a single axis above the horizontal, degrees: the force along it is g·sin of it."""
MEANINGS: dict[str, str] = {
    **{row.mapped: row.column for row in RECORDED if row.mapped},
    "n": "n",
    "duration": "duration_s",
    "tilt": TILT,
    **{name: name for name in (*SPREAD_COLUMNS, *FORCE_COLUMNS)},
}
"""Further names of a mapping and the columns that they become; a column may be mapped by its own name, too."""
_OF_COLUMN = {column: meaning for meaning, column in MEANINGS.items()}
KNOWN = ("time", *NEEDED, "unit", "dwell", *MEANINGS)
RESERVED = frozenset({
    *("record", "kind", "pose", "soak", "out_unit", "status", "rate_hz", *OUTPUT_COLUMNS),
    *("outer_command_deg", "inner_command_deg", "time_s"),
})  # fmt: skip
"""Columns that the tables of an import have with a meaning of their own: no covariate may have these names."""
SHORTEST_BLOCK_S = 1e-3
MOST_POSITIONS = 2000
LONGEST_NAME = 200

OUTPUT_UNITS: dict[str, tuple[str, float]] = {
    "g": ("g", 1.0),
    "mg": ("g", 1e-3),
    "m/s^2": ("m/s^2", 1.0),
    "V": ("V", 1.0),
    "mV": ("V", 1e-3),
    "LSB": ("LSB", 1.0),
}
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
TEMPERATURE_UNITS = ("degC", "K", "degF")
_KNOWN_UNITS = {
    "output": ("the output", tuple(OUTPUT_UNITS)),
    "time": ("time", ("", *TIME_UNITS, "samples")),
    "temperature": ("temperature", TEMPERATURE_UNITS),
}
FACES = {
    f"{sign}{axis}": tuple(float(sign + "1") * (axis == other) for other in "xyz") for sign in "+-" for axis in "xyz"
}
"""Specific force, in units of local gravity, with an axis up (+) or down (-)."""


class Units(BaseModel):
    """Units of the source."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    output: str
    time: str = ""
    """Empty: as stated by the file, or recognised from its steps."""
    temperature: str = "degC"

    @field_validator("output", "time", "temperature")
    @classmethod
    def _known(cls, value: str, info: ValidationInfo) -> str:
        quantity, known = _KNOWN_UNITS[str(info.field_name)]
        if value not in known:
            raise ValueError(
                f"found '{shown(value)}', a known unit of {quantity} is needed: {', '.join(filter(None, known))}"
            )
        return value


class Mapping(BaseModel):
    """The mapping of a foreign file: meaning of its columns, units, and the treatment of gaps and faults."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    columns: dict[str, str]
    """Meaning → column of the file; unknown names become covariates."""
    units: Units
    unit: str = ""
    """Serial number, if the file has no column for it."""
    device: str = ""
    """Kind of device of the units; empty: not stated."""
    zone: str = ""
    """Zone of stamps of date and time that state none, such as Europe/Berlin; empty: their clock was not changed."""
    rows: Literal["samples", "dwells"] = "samples"
    rate_hz: Annotated[float, Field(gt=0.0, le=FASTEST_HZ)] | None = None
    axes: Annotated[tuple[Literal["x", "y", "z"], ...], Field(min_length=1, max_length=3)] = NEEDED
    """Mapped axes in the order in which they become x, y, z; fewer than three for a device with one axis or two."""
    signs: Annotated[tuple[Literal["+", "-"], ...], Field(min_length=1, max_length=3)] = ("+", "+", "+")
    local_gravity_m_s2: Annotated[float, Field(gt=9.7, lt=9.9)] | None = None
    poses: dict[str, str] = Field(default_factory=dict)
    """Label of a dwell → face up, as +x … -z; with any given, dwells with other labels are left out."""
    headings: dict[str, Annotated[float, Field(ge=-360.0, le=360.0)]] = Field(default_factory=dict)
    """Label of a dwell → heading of its placement, degrees: direction of x about the vertical, of y where x is up or down."""
    verify: str = ""
    """Dwells of a unit that are held out to verify the fit: a number, or a share such as 20%."""
    measured: date | None = None
    """Day of the measurement."""
    zero_output: Annotated[float, Field(ge=-LARGEST, le=LARGEST)] = 0.0
    """Nominal output at 0 g, in the unit of the file's outputs."""
    face: Literal["", "+x", "+y", "+z", "-x", "-y", "-z"] = ""
    """The face that is up all the time, for a record in one pose."""
    block_s: Annotated[float, Field(ge=SHORTEST_BLOCK_S, le=LONGEST_WAIT_S)] | None = None
    """Dwells of this length instead of detected ones, for a record in one pose."""
    positions: Annotated[int, Field(ge=2, le=MOST_POSITIONS)] | None = None
    """Count of positions logged back to back, without the moves between them."""
    window_s: Annotated[float, Field(ge=SHORTEST_BLOCK_S, le=LONGEST_WAIT_S)] | None = None
    """Length of the sliding window of the search for dwells."""
    threshold: Annotated[float, Field(gt=0.0, le=LARGEST)] | None = None
    """Standard deviation of a window that means motion, in the unit of the file's outputs."""
    shortest_s: Annotated[float, Field(ge=SHORTEST_BLOCK_S, le=LONGEST_WAIT_S)] | None = None
    """Shortest dwell."""
    gaps: Literal["refuse", "split"] = "refuse"
    """Treatment of rows without a number, and of gaps in time."""
    faulty: Literal["refuse", "leave-out", "keep"] = "refuse"
    """Treatment of samples of a constant axis, and of torn words."""
    group: str = ""
    """Group of channels, if a file has several with their own clocks."""
    join: Literal["", "rows", "columns"] = ""
    """How several files are joined: one after another, or side by side."""

    @field_validator("columns")
    @classmethod
    def _complete(cls, value: dict[str, str]) -> dict[str, str]:
        columns: dict[str, str] = {}
        for name, column in value.items():
            meaning = _OF_COLUMN.get(name, name)
            if meaning in columns:
                raise ValueError(f"{meaning} is mapped twice, once by the name of its column; remove one")
            columns[meaning] = column
            if name in RESERVED:
                other = {"time_s": "time", **dict(zip(OUTPUT_COLUMNS, NEEDED, strict=True))}.get(name)
                hint = f"map it as '{other}'" if other else "choose another name for the covariate"
                raise ValueError(f"'{shown(name)}' is the name of a column that an import writes itself; {hint}")
            if not (name.isprintable() and 0 < len(name) <= LONGEST_NAME):
                raise ValueError(
                    f"'{shown(name)}': a name of 1 to {LONGEST_NAME} printable characters is needed; choose another"
                )
        return columns

    @field_validator("zone")
    @classmethod
    def _in_the_database(cls, value: str) -> str:
        known = available_timezones() if value else set[str]()
        if value and not known:
            raise ValueError("this machine has no data base of time zones; install the package tzdata")
        if value and value not in known:
            close = did_you_mean(
                value, close_matches(value, known) or ("Europe/Berlin, and others of the IANA data base",)
            )
            raise ValueError(f"no zone '{shown(value)}'; {close}")
        return value

    @field_validator("axes")
    @classmethod
    def _each_once(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(value)) < len(value):
            raise ValueError(f"{','.join(value)}: every axis is needed once")
        return value

    @field_validator("poses")
    @classmethod
    def _faces(cls, value: dict[str, str]) -> dict[str, str]:
        for label, face in value.items():
            if face not in FACES:
                raise ValueError(f"'{label}': found '{shown(face)}', one of {', '.join(FACES)} is needed")
        return value

    @model_validator(mode="after")
    def _mapped_axes(self) -> Mapping:
        mapped = [name for name in NEEDED if name in self.columns]
        missing = [name for name in NEEDED if name in self.axes and name not in mapped]
        if missing and len(self.axes) == len(NEEDED):
            fewer = f", or --set axes={','.join(mapped)} for a device with fewer axes" if mapped else ""
            raise ValueError(f"{', '.join(missing)} not mapped; x, y and z are needed{fewer}")
        if set(mapped) != set(self.axes):
            raise ValueError(
                f"axes are {', '.join(self.axes)}, and {', '.join(mapped) or 'no output'} mapped; each needs a column of its own"
            )
        alone = [name for name in SPREAD_COLUMNS if name in self.columns and name[-1] not in mapped]
        if alone:
            raise ValueError(
                f"{alone[0]} without {alone[0][-1]}; a standard deviation belongs to an output: map it too"
            )
        search = [
            name for name in ("block_s", "window_s", "threshold", "shortest_s") if getattr(self, name) is not None
        ]
        if search and self.rows == "dwells":
            raise ValueError(f"{search[0]} finds dwells in samples, each row is a dwell already; leave it out")
        if len(self.signs) not in {len(self.axes), len(NEEDED)}:
            raise ValueError(f"{len(self.signs)} signs for {len(self.axes)} axes; one for each axis is needed")
        if "tilt" in self.columns and len(self.axes) == len(NEEDED):
            raise ValueError("tilt is the reference of a single axis; give the angles of the table as outer and inner")
        if "tilt" in self.columns and (self.poses or self.face or len(self.axes) > 1):
            raise ValueError("tilt is the reference of a single axis; give it without poses, for one axis")
        return self

    @model_validator(mode="after")
    def _headings_of_poses(self) -> Mapping:
        if not self.headings:
            return self
        if "heading" in self.columns:
            raise ValueError("headings: there is a column of headings as well, one of the two is needed; remove one")
        missing = [label for label in self.poses if label not in self.headings]
        more = [label for label in self.headings if label not in self.poses]
        if missing or more:
            words = f"'{shown(missing[0])}' has none" if missing else f"'{shown(more[0])}' is no pose"
            raise ValueError(
                f"headings: {words}, a heading for every pose is needed; give headings for the labels of poses"
            )
        return self

    @property
    def letters(self) -> tuple[str, ...]:
        """Letters of the outputs in the tables: x, y, z, or as many of them as the device has axes."""
        return NEEDED[: len(self.axes)]

    @property
    def likely_slips(self) -> dict[str, tuple[str, ...]]:
        """Covariates whose names are close to known names, with these names: possibly misspelt, but allowed."""
        similar = {name: close_matches(name, KNOWN) for name in self.columns if name not in KNOWN and len(name) > 1}
        return {name: close for name, close in similar.items() if close}

    @property
    def norm_g(self) -> float | None:
        """Local gravity in g; None if not given."""
        return None if self.local_gravity_m_s2 is None else self.local_gravity_m_s2 / STANDARD_GRAVITY_M_S2


def build(content: dict[str, Any], where: str) -> Mapping:
    """The mapping of `content`, or `RecipeInvalid` that names the key and its close matches."""
    try:
        return Mapping.model_validate(content)
    except ValidationError as problem:
        first = problem.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        words = shown(first["msg"].removeprefix("Value error, "), 400)
        if not first["msg"].startswith("Value error, ") and not isinstance(first["input"], dict | list):
            words = f"found {shown(first['input'])}: {words[:1].lower()}{words[1:]}; correct it"
        close: tuple[str, ...] = ()
        if first["type"] == "extra_forbidden":
            known = Units.model_fields if first["loc"][0] == "units" else Mapping.model_fields
            close = close_matches(str(first["loc"][-1]), known)
            words = f"this key is not known; {did_you_mean(str(first['loc'][-1]), known)}"
        elif first["type"] == "missing":
            words = "it is needed; add it"
        raise RecipeInvalid(": ".join(filter(None, (where, shown(key), words))), key=key, close=close) from None


def of_exchange(table: pd.DataFrame, keys: dict[str, Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The keys that map a table of dwells in the exchange format, and a remark on columns that a mapping does not read."""
    named = {"time_s": "time", **dict(zip(OUTPUT_COLUMNS, NEEDED, strict=True))}
    texts = [name for name in table.columns if name != "unit" and not pd.api.types.is_numeric_dtype(table[name])]
    unread = [name for name in table.columns if name in (*texts, *SLOW_COLUMNS, *RESERVED - set(named))]
    columns = {named.get(name, name): name for name in table.columns if name not in unread}
    units = dict(keys.get("units", {}))
    if "out_unit" in table.columns:
        unread.remove("out_unit")
        stated = ", ".join(map(str, table["out_unit"].unique()))
        if units.setdefault("output", stated) != stated:
            raise WrongUse(
                f"import: --unit-of output={units['output']}, the table's out_unit is {shown(stated)}; correct one of the two"
            )
    told = (f"columns that are not read with --references, --fit or --set: {', '.join(unread)}",) if unread else ()
    return {**keys, "columns": columns, "units": units, "rows": "dwells"}, told


def from_file(path: Path) -> dict[str, Any]:
    """The content of a mapping file."""
    return parse_toml(read_text(path, "mapping"), f"mapping {path.name}")


def pairs(text: str, option: str) -> dict[str, str]:
    """name=value pairs of an option, divided by commas."""
    by_name: dict[str, str] = {}
    for part in filter(None, (piece.strip() for piece in text.split(","))):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value):
            raise WrongUse(f"{option}: found '{shown(part)}', name=value is needed, divided by commas; correct it")
        if name in by_name:
            raise WrongUse(f"{option}: '{name}' is there twice, once is needed; remove one")
        by_name[name] = value
    return by_name
