"""The tables that cross a stage boundary: columns, types and what every row must satisfy.

``check(name, frame)`` gives the frame back or raises :class:`DataRejected` with unit, row, value and what is needed.
Every table has a schema version that travels with its file.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pandera.pandas as pa

from schemas import version
from schemas.units import AXES

if TYPE_CHECKING:
    from collections.abc import Sequence

VERSION = version.VERSION
KINDS = ("dwell", "verification", "allan", "procedure")
OUTPUT_UNITS = ("V", "LSB", "g", "m/s^2")
OUTCOMES = ("pass", "fail", "refused")


@dataclass(frozen=True)
class Table:
    """The contract of one table.

    Parameters
    ----------
    columns : the columns that must be there, with their checks.
    finite : columns in which NaN and infinity are refused; all of them are numbers.
    key : columns that together name a row; no two rows may share them.
    only_ok : finite columns count only in rows whose ``status`` is ``ok``.
    """

    columns: dict[str, pa.Column]
    finite: tuple[str, ...] = ()
    key: tuple[str, ...] = ()
    only_ok: bool = False
    schema: pa.DataFrameSchema = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "schema", pa.DataFrameSchema(self.columns, strict=False, coerce=True))


def _text(*allowed: str) -> pa.Column:
    checks = [pa.Check.isin(list(allowed))] if allowed else [pa.Check.str_length(min_value=1)]
    return pa.Column(str, checks=checks)


def _number(*, low: float | None = None, missing: bool = False) -> pa.Column:
    return pa.Column(float, checks=[pa.Check.ge(low)] if low is not None else [], nullable=missing)


def _whole(low: int = 0) -> pa.Column:
    return pa.Column("int64", checks=[pa.Check.ge(low)])


def _numbers(names: Sequence[str]) -> dict[str, pa.Column]:
    return {name: _number() for name in names}


def _gaps(names: Sequence[str]) -> dict[str, pa.Column]:
    return {name: _number(missing=True) for name in names}


_OUT = ("out_x", "out_y", "out_z")
_SD = ("sd_x", "sd_y", "sd_z")
_FORCE = ("force_x", "force_y", "force_z")
_PLACE = {"unit": _text(), "slot": _whole(), "record": _whole(), "kind": _text(*KINDS)}
_ANGLES = ("outer_deg", "inner_deg", "outer_command_deg", "inner_command_deg")
_SURROUNDINGS = (
    "chamber_C",
    "unit_C",
    "supply_V",
    "vibration_g",
    "since_move_s",
    "since_power_s",
)

TABLES: dict[str, Table] = {
    # Samples may hold NaN: what a device really sent is kept, and the validate stage refuses the unit.
    "samples": Table({**_PLACE, "time_s": _number(), **_gaps(AXES)}, finite=("time_s",)),
    "readings": Table(
        {
            **_PLACE,
            "pose": _text(),
            "soak": _whole(),
            **_gaps(_ANGLES),
            **_gaps(_SURROUNDINGS),
            **_numbers(("start_s", "duration_s", "rate_hz")),
            "n": _whole(),
            "overflow": pa.Column(bool),
            "status": _text(),
            "out_unit": _text(*OUTPUT_UNITS),
            "full_scale": _number(low=0.0),
        },
        finite=(
            *_ANGLES,
            "chamber_C",
            "unit_C",
            "start_s",
            "duration_s",
            "rate_hz",
            "full_scale",
        ),
        key=("unit", "record"),
        only_ok=True,
    ),
    "history": Table(
        {
            "time_s": _number(),
            "chamber_C": _number(),
            "slot": _whole(),
            "unit": _text(),
            **_gaps(("unit_C",)),
        },
        finite=("time_s", "chamber_C"),
    ),
    "events": Table(
        {
            "time_s": _number(),
            "kind": _text(),
            "record": _whole(-1),  # −1: none
            "reason": pa.Column(str),
            "action": pa.Column(str),
        },
        finite=("time_s",),
    ),
    "soaks": Table(
        {
            "time_s": _number(),
            "record": _whole(),
            **_numbers(("target_C", "seconds", "air_overshoot_K", "device_overshoot_K")),
        },
        finite=("time_s", "target_C", "seconds", "air_overshoot_K", "device_overshoot_K"),
    ),
    "verdicts": Table(
        {
            "unit": _text(),
            "slot": _whole(),
            "refused": pa.Column(bool),
            "fault": pa.Column(str),
            "reason": pa.Column(str),
        },
        key=("unit",),
    ),
    "dwells": Table(
        {"unit": _text(), "dwell": _whole(), "time_s": _number(), **_numbers(_OUT)},
        finite=(
            "time_s",
            *_OUT,
            *_SD,
            *_FORCE,
            "outer_deg",
            "inner_deg",
            "unit_C",
            "chamber_C",
        ),
        key=("unit", "dwell"),
    ),
    "coefficients": Table(
        {
            "unit": _text(),
            "axis": _text(*AXES, "*"),
            "effect": _text(),
            "name": _text(),
            **_numbers(("value", "standard_error")),
            "unit_text": pa.Column(str),
        },
        finite=("value", "standard_error"),
        key=("unit", "axis", "effect", "name"),
    ),
    "covariance": Table(
        {
            "unit": _text(),
            "axis": _text(*AXES),
            "row": _whole(),
            "column": _whole(),
            "value": _number(),
        },
        finite=("value",),
        key=("unit", "axis", "row", "column"),
    ),
    "residuals": Table(
        {
            "unit": _text(),
            "dwell": _whole(),
            "axis": _text(*AXES, "norm"),
            "pose": _text(),
            **_numbers(("force_g", "residual_ug", "standard_error_ug", "expected_ug")),
            **_gaps(("unit_C",)),
        },
        finite=("residual_ug", "force_g", "standard_error_ug", "expected_ug"),
        key=("unit", "dwell", "axis"),
    ),
    "predictions": Table(
        {
            "unit": _text(),
            "axis": _text(*AXES),
            "dwell": _whole(),
            "other": _whole(),
            "covariance_ug2": _number(),
        },
        finite=("covariance_ug2",),
        key=("unit", "axis", "dwell", "other"),
    ),
    "wander": Table(
        {
            "unit": _text(),
            "axis": _text(*AXES),
            "method": _text("wander", "birge"),
            **_numbers(("white_ug", "flicker_ug", "walk_ug", "lack_of_fit")),
            "dof": _whole(),
        },
        finite=("white_ug", "flicker_ug", "walk_ug", "lack_of_fit"),
        key=("unit", "axis"),
    ),
    "verification": Table(
        {
            "unit": _text(),
            "dwell": _whole(),
            "pose": _text(),
            **_numbers(
                (
                    "norm_g",
                    "error_ug",
                    "uncertainty_ug",
                    "error_x_ug",
                    "error_y_ug",
                    "error_z_ug",
                )
            ),
        },
        finite=(
            "norm_g",
            "error_ug",
            "uncertainty_ug",
            "error_x_ug",
            "error_y_ug",
            "error_z_ug",
        ),
        key=("unit", "dwell"),
    ),
    "verification_poses": Table(
        {"unit": _text(), "pose": _text(), "dwells": _whole(1), **_numbers(("error_ug", "uncertainty_ug"))},
        finite=("error_ug", "uncertainty_ug"),
        key=("unit", "pose"),
    ),
    "allan": Table(
        {
            "unit": _text(),
            "axis": _text(*AXES),
            **_numbers(("tau_s", "deviation_ug", "low_ug", "high_ug")),
            **_gaps(("fitted_ug",)),
        },
        finite=("tau_s", "deviation_ug", "low_ug", "high_ug"),
        key=("unit", "axis", "tau_s"),
    ),
    "noise": Table(
        {
            "unit": _text(),
            "axis": _text(*AXES),
            "term": _text(),
            **_gaps(("value", "low", "high")),
            "identified": pa.Column(bool),
            "unit_text": pa.Column(str),
        },
        key=("unit", "axis", "term"),
    ),
    "procedure_points": Table(
        {
            **{name: _text() for name in ("unit", "procedure", "axis", "series")},
            **{name: _whole() for name in ("number", "point")},
            **_gaps(("setting", "value", "uncertainty")),
        },
        key=("number", "unit", "axis", "series", "point"),
    ),
    "procedure_figures": Table(
        {
            **{name: _text() for name in ("unit", "procedure", "figure", "axis")},
            "number": _whole(),
            **_gaps(("value", "uncertainty", "low", "high")),
            "identified": pa.Column(bool),
            "unit_text": _text(),
            "note": pa.Column(str),
        },
        key=("number", "unit", "figure", "axis"),
    ),
    "procedure_findings": Table(
        {"unit": pa.Column(str), "procedure": _text(), "number": _whole(), "subject": _text(), "text": _text()}
    ),
    "figures": Table(
        {
            "unit": _text(),
            "figure": _text(),
            **_numbers(("value", "uncertainty")),
            "limit": _number(missing=True),
            "unit_text": pa.Column(str),
            "outcome": _text(),
            "rule": pa.Column(str),
        },
        finite=("value", "uncertainty"),
        key=("unit", "figure"),
    ),
    # one row per unit, quantity and contribution
    "budget": Table(
        {
            **{name: _text() for name in ("unit", "quantity", "axis", "contribution", "type", "distribution", "scope")},
            **{name: pa.Column(str) for name in ("unit_text", "input_unit", "source")},
            **_numbers(("u", "share", "divisor", "stated")),
            **_gaps(("dof", "sensitivity", "visible")),
        },
        finite=("u", "share"),
        key=("unit", "quantity", "axis", "contribution"),
    ),
    "uncertainties": Table(
        {
            **{name: _text() for name in ("unit", "quantity", "axis", "frame")},
            **{name: pa.Column(str) for name in ("unit_text", "largest")},
            **_numbers(("value", "u_a", "u_b", "u", "k", "expanded")),
            **_gaps(("dof", "shown", "unseen")),
        },
        finite=("value", "u_a", "u_b", "u", "k", "expanded"),
        key=("unit", "quantity", "axis"),
    ),
    # of the coefficients of all axes in one vector, x before y before z, lower triangle
    "budget_covariance": Table(
        {"unit": _text(), "row": _whole(), "column": _whole(), "value": _number()},
        finite=("value",),
        key=("unit", "row", "column"),
    ),
    # risks of the decisions over the production that a lot stands for
    "lot_risks": Table(
        {
            "figure": _text(),
            "unit_text": pa.Column(str),
            "units": _whole(1),
            **_numbers(("mean", "u", "limit", "accept")),
            **_gaps(("process", "pfa", "pfr", "accepted", "largest_pfa")),
        },
        finite=("mean", "u", "limit", "accept"),
        key=("figure",),
    ),
    "grades": Table(
        {
            "unit": _text(),
            "slot": _whole(),
            "outcome": _text(*OUTCOMES),
            "grade": pa.Column(str),
            "reasons": pa.Column(str),
            "rule": pa.Column(str),
        },
        key=("unit",),
    ),
}
