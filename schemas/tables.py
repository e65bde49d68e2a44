"""The tables that cross a stage boundary: columns, types and what every row must satisfy.

Every table has a schema version that travels with its file.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

from schemas import version
from schemas.units import AXES

if TYPE_CHECKING:
    import pandera.pandas as pa

VERSION = version.VERSION
KINDS = ("dwell", "verification", "allan", "procedure")
OUTPUT_UNITS = ("V", "LSB", "g", "m/s^2")
OUTCOMES = ("pass", "fail", "refused")
ADEQUATE, NOT_ADEQUATE, NOT_JUDGED = VERDICTS = ("adequate", "not adequate", "not judged")

Kind = Literal["str", "float64", "int64", "bool"]
"""The types of columns, by pandas' names."""


@dataclass(frozen=True)
class Column:
    """What every value of a column must satisfy.

    kind : type; low : smallest number, None for any; allowed : the texts that may be there, none for any
    filled : whether a text may not be empty; missing : whether numbers may be NaN
    """

    kind: Kind
    low: float | None = None
    allowed: tuple[str, ...] = ()
    filled: bool = False
    missing: bool = False

    def contract(self) -> "pa.Column":
        """The column in the form of the library that explains violations."""
        import pandera.pandas as pa  # noqa: PLC0415 - a table without an error does not need it

        checks = [pa.Check.ge(self.low)] if self.low is not None else []
        checks += [pa.Check.isin(list(self.allowed))] if self.allowed else []
        checks += [pa.Check.str_length(min_value=1)] if self.filled else []
        return pa.Column(str if self.kind == "str" else self.kind, checks=checks, nullable=self.missing)


@dataclass(frozen=True)
class Table:
    """The contract of one table.

    Parameters
    ----------
    columns : the columns that must be there, with what their values must satisfy.
    measured : columns of numbers that need not be there, or may have gaps in rows that do not count.
    key : columns that together name a row; no two rows may share them.
    only_ok : numbers count only in rows whose ``status`` is ``ok``.
    """

    columns: dict[str, Column]
    measured: tuple[str, ...] = ()
    key: tuple[str, ...] = ()
    only_ok: bool = False

    @cached_property
    def finite(self) -> tuple[str, ...]:
        """Columns of numbers in which NaN and infinity are refused."""
        needed = (name for name, c in self.columns.items() if c.kind == "float64" and not c.missing)
        return (*needed, *self.measured)

    @cached_property
    def schema(self) -> "pa.DataFrameSchema":
        """The contract for the library that explains what is wrong."""
        import pandera.pandas as pa  # noqa: PLC0415 - a table without an error does not need it

        return pa.DataFrameSchema(
            {name: column.contract() for name, column in self.columns.items()}, strict=False, coerce=True
        )


def each(column: Column, *names: str) -> dict[str, Column]:
    """A column under each of several names."""
    return dict.fromkeys(names, column)


def text(*allowed: str) -> Column:
    """A text: one of the allowed texts, or any that is not empty."""
    return Column("str", allowed=allowed, filled=not allowed)


ANY_TEXT = Column("str")
"""A text that may be empty."""
FLAG = Column("bool")
NUMBER = Column("float64")
"""A number that is not missing."""
GAPS = Column("float64", missing=True)
"""A number that may be NaN."""
WHOLE = Column("int64", low=0)

_OUT = ("out_x", "out_y", "out_z")
_SD = ("sd_x", "sd_y", "sd_z")
_FORCE = ("force_x", "force_y", "force_z")
_ANGLES = ("outer_deg", "inner_deg", "outer_command_deg", "inner_command_deg")
_SURROUNDINGS = ("chamber_C", "unit_C", "supply_V", "vibration_g", "since_move_s", "since_power_s")
_UNIT, _AXIS = each(text(), "unit"), each(text(*AXES), "axis")
_RECORD = {**_UNIT, **each(WHOLE, "slot", "record"), "kind": text(*KINDS)}

TABLES: dict[str, Table] = {
    # Samples may hold NaN: what a device really sent is stored, and the validate stage refuses the unit.
    "samples": Table({**_RECORD, "time_s": NUMBER, **each(GAPS, *AXES)}),
    "readings": Table(
        {
            **_RECORD,
            "pose": text(),
            "soak": WHOLE,
            **each(GAPS, *_ANGLES, *_SURROUNDINGS),
            **each(NUMBER, "start_s", "duration_s", "rate_hz"),
            "n": WHOLE,
            "overflow": FLAG,
            "status": text(),
            "out_unit": text(*OUTPUT_UNITS),
            "full_scale": Column("float64", low=0.0),
        },
        measured=(*_ANGLES, "chamber_C", "unit_C"),
        key=("unit", "record"),
        only_ok=True,
    ),
    "history": Table({**each(NUMBER, "time_s", "chamber_C"), "slot": WHOLE, **_UNIT, "unit_C": GAPS}),
    "events": Table(
        {
            "time_s": NUMBER,
            "kind": text(),
            "record": Column("int64", low=-1),  # −1: none
            **each(ANY_TEXT, "reason", "action"),
        },
    ),
    "soaks": Table(
        {
            "time_s": NUMBER,
            "record": WHOLE,
            **each(NUMBER, "target_C", "seconds", "air_overshoot_K", "device_overshoot_K"),
        },
    ),
    "verdicts": Table(
        {**_UNIT, "slot": WHOLE, "refused": FLAG, **each(ANY_TEXT, "fault", "reason")},
        key=("unit",),
    ),
    "dwells": Table(
        {**_UNIT, "dwell": WHOLE, "time_s": NUMBER},
        measured=(*_OUT, *_SD, *_FORCE, "outer_deg", "inner_deg", "unit_C", "chamber_C"),
        key=("unit", "dwell"),
    ),
    "coefficients": Table(
        {
            **_UNIT,
            "axis": text(*AXES, "*"),
            **each(text(), "effect", "name"),
            **each(NUMBER, "value", "standard_error"),
            "unit_text": ANY_TEXT,
        },
        key=("unit", "axis", "effect", "name"),
    ),
    "covariance": Table(
        {**_UNIT, **_AXIS, **each(WHOLE, "row", "column"), "value": NUMBER},
        key=("unit", "axis", "row", "column"),
    ),
    "residuals": Table(
        {
            **_UNIT,
            "dwell": WHOLE,
            "axis": text(*AXES, "norm"),
            "pose": text(),
            **each(NUMBER, "force_g", "residual_ug", "standard_error_ug", "expected_ug"),
            "unit_C": GAPS,
        },
        key=("unit", "dwell", "axis"),
    ),
    "predictions": Table(
        {**_UNIT, **_AXIS, **each(WHOLE, "dwell", "other"), "covariance_ug2": NUMBER},
        key=("unit", "axis", "dwell", "other"),
    ),
    "wander": Table(
        {
            **_UNIT,
            **_AXIS,
            "method": text("wander", "birge"),
            **each(NUMBER, "white_ug", "flicker_ug", "walk_ug", "lack_of_fit"),
            "dof": WHOLE,
        },
        key=("unit", "axis"),
    ),
    # of the coefficients, from earlier calibrations of the family; no rows without a prior
    "prior": Table(
        {
            **_UNIT,
            **_AXIS,
            **each(text(), "effect", "name"),
            **each(NUMBER, "mean", "standard_deviation", "share", "widened", "p_value"),
            **each(FLAG, "fits", "own"),
            "units": WHOLE,
        },
        key=("unit", "axis", "effect", "name"),
    ),
    "verification": Table(
        {**_UNIT, "dwell": WHOLE, "pose": text(), **each(NUMBER, "norm_g", "error_ug", "uncertainty_ug")},
        measured=("error_x_ug", "error_y_ug", "error_z_ug"),
        key=("unit", "dwell"),
    ),
    "verification_poses": Table(
        {**_UNIT, "pose": text(), "dwells": Column("int64", low=1), **each(NUMBER, "error_ug", "uncertainty_ug")},
        key=("unit", "pose"),
    ),
    "allan": Table(
        {**_UNIT, **_AXIS, **each(NUMBER, "tau_s", "deviation_ug", "low_ug", "high_ug"), "fitted_ug": GAPS},
        key=("unit", "axis", "tau_s"),
    ),
    "noise": Table(
        {
            **_UNIT,
            **_AXIS,
            "term": text(),
            **each(GAPS, "value", "low", "high"),
            "identified": FLAG,
            "unit_text": ANY_TEXT,
        },
        key=("unit", "axis", "term"),
    ),
    # white noise of the dwells of each soak, with its curve over temperature
    "soak_noise": Table(
        {
            **_UNIT,
            **_AXIS,
            **each(WHOLE, "soak", "dwells"),
            "temperature_C": NUMBER,
            **each(GAPS, "value", "low", "high", "curve", "curve_u"),
            "identified": FLAG,
            **each(ANY_TEXT, "unit_text", "note"),
        },
        key=("unit", "axis", "soak"),
    ),
    "noise_temperature": Table(
        {
            **_UNIT,
            **_AXIS,
            **each(NUMBER, "cold_C", "hot_C", "ratio", "low", "high"),
            "p_value": GAPS,
            "verdict": text(),
        },
        key=("unit", "axis"),
    ),
    "procedure_points": Table(
        {
            **each(text(), "unit", "procedure", "axis", "series"),
            **each(WHOLE, "number", "point"),
            **each(GAPS, "setting", "value", "uncertainty"),
        },
        key=("number", "unit", "axis", "series", "point"),
    ),
    "procedure_figures": Table(
        {
            **each(text(), "unit", "procedure", "figure", "axis"),
            "number": WHOLE,
            **each(GAPS, "value", "uncertainty", "low", "high"),
            "identified": FLAG,
            "unit_text": text(),
            "note": ANY_TEXT,
        },
        key=("number", "unit", "figure", "axis"),
    ),
    "procedure_findings": Table(
        {"unit": ANY_TEXT, "procedure": text(), "number": WHOLE, **each(text(), "subject", "text")}
    ),
    # results by comparison: what records and recipe add to the uncertainty, and the sensitivity to each term of the comparison
    "procedure_results": Table(
        {
            **each(text(), "unit", "procedure", "role", "quantity", "axis", "unit_text"),
            **each(WHOLE, "number", "point"),
            "value": NUMBER,
            **each(GAPS, "setting", "dof"),
        },
        key=("number", "unit", "quantity", "axis", "point"),
    ),
    # the models that such results rest on, with the lower triangle of the covariance of the parameters
    "procedure_curves": Table(
        {
            **each(text(), "unit", "procedure", "axis", "model"),
            "verdict": text(*VERDICTS),
            **each(ANY_TEXT, "reason", "name"),
            **each(WHOLE, "number", "row", "column"),
            **each(GAPS, "value", "p_value", "low_hz", "high_hz"),
        },
        key=("number", "unit", "axis", "row", "column"),
    ),
    "figures": Table(
        {
            **each(text(), "unit", "figure"),
            **each(NUMBER, "value", "uncertainty"),
            "limit": GAPS,
            "unit_text": ANY_TEXT,
            "outcome": text(),
            "rule": ANY_TEXT,
        },
        key=("unit", "figure"),
    ),
    # one row per unit, quantity and contribution
    "budget": Table(
        {
            **each(text(), "unit", "quantity", "axis", "contribution", "type", "distribution", "scope"),
            **each(ANY_TEXT, "unit_text", "input_unit", "source"),
            **each(NUMBER, "u", "share", "divisor", "stated"),
            **each(GAPS, "dof", "sensitivity", "visible"),
        },
        key=("unit", "quantity", "axis", "contribution"),
    ),
    "uncertainties": Table(
        {
            **each(text(), "unit", "quantity", "axis", "frame"),
            **each(ANY_TEXT, "unit_text", "largest"),
            **each(NUMBER, "value", "u_a", "u_b", "u"),
            # no k and U of a value that is a standard deviation or a bound by itself
            **each(GAPS, "k", "expanded", "dof", "shown", "unseen"),
        },
        key=("unit", "quantity", "axis"),
    ),
    # of the coefficients of all axes in one vector, x before y before z, lower triangle
    "budget_covariance": Table(
        {**_UNIT, **each(WHOLE, "row", "column"), "value": NUMBER},
        key=("unit", "row", "column"),
    ),
    # on the model of the run: the effects of the fit; one row, none without a model
    "verdict": Table(
        {
            "model": text(),
            "verdict": text(*VERDICTS),
            **each(ANY_TEXT, "reason", "faulty"),
            **each(GAPS, "rms_ug", "floor_ug", "p_value"),
            "named": FLAG,
            "units": WHOLE,
        },
        # variances of the noise over the white one, where all units and axes have the same: what follows needs no search
        measured=("flicker_share", "walk_share"),
        key=("model",),
    ),
    # risks of the decisions over the production that a lot stands for
    "lot_risks": Table(
        {
            "figure": text(),
            "unit_text": ANY_TEXT,
            "units": Column("int64", low=1),
            **each(NUMBER, "mean", "u", "limit", "accept"),
            **each(GAPS, "process", "pfa", "pfr", "accepted", "largest_pfa"),
        },
        key=("figure",),
    ),
    "grades": Table(
        {**_UNIT, "slot": WHOLE, "outcome": text(*OUTCOMES), **each(ANY_TEXT, "grade", "reasons", "rule")},
        key=("unit",),
    ),
}
