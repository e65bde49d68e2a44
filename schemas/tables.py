"""The tables that cross a stage boundary: columns, types and what every row must satisfy.

``check(name, frame)`` gives the frame back or raises :class:`DataRejected` with unit, row, value and what is needed.
Every table has a schema version that travels with its file.
"""

from __future__ import annotations

from dataclasses import dataclass

from schemas import version
from schemas.columns import Column
from schemas.units import AXES

VERSION = version.VERSION
KINDS = ("dwell", "verification", "allan", "procedure")
OUTPUT_UNITS = ("V", "LSB", "g", "m/s^2")
OUTCOMES = ("pass", "fail", "refused")


@dataclass(frozen=True)
class Table:
    """The contract of one table.

    Parameters
    ----------
    columns : the columns that must be there, with their contracts; numbers are finite unless they may be missing.
    finite : numbers that are finite where they are there: columns that a table need not have, or that may be missing.
    key : columns that together name a row; no two rows may share them.
    only_ok : ``finite`` counts only in rows whose ``status`` is ``ok``.
    """

    columns: dict[str, Column]
    finite: tuple[str, ...] = ()
    key: tuple[str, ...] = ()
    only_ok: bool = False


TEXT, WHOLE, FLAG, NUMBER = Column("text"), Column("whole", low=0), Column("flag"), Column("number")
REMARK = Column("text", empty=True)


def _one_of(*allowed: str) -> Column:
    return Column("text", allowed=allowed)


def _numbers(*names: str) -> dict[str, Column]:
    return dict.fromkeys(names, NUMBER)


def _gaps(*names: str) -> dict[str, Column]:
    return dict.fromkeys(names, Column("number", missing=True))


def _texts(*names: str) -> dict[str, Column]:
    return dict.fromkeys(names, TEXT)


_OUT = ("out_x", "out_y", "out_z")
_SD = ("sd_x", "sd_y", "sd_z")
_FORCE = ("force_x", "force_y", "force_z")
_PLACE = {"unit": TEXT, "slot": WHOLE, "record": WHOLE, "kind": _one_of(*KINDS)}
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
    "samples": Table({**_PLACE, "time_s": NUMBER, **_gaps(*AXES)}),
    "readings": Table(
        {
            **_PLACE,
            "pose": TEXT,
            "soak": WHOLE,
            **_gaps(*_ANGLES),
            **_gaps(*_SURROUNDINGS),
            **_numbers("start_s", "duration_s", "rate_hz"),
            "n": WHOLE,
            "overflow": FLAG,
            "status": TEXT,
            "out_unit": _one_of(*OUTPUT_UNITS),
            "full_scale": Column("number", low=0.0),
        },
        finite=(*_ANGLES, "chamber_C", "unit_C"),
        key=("unit", "record"),
        only_ok=True,
    ),
    "history": Table(
        {
            "time_s": NUMBER,
            "chamber_C": NUMBER,
            "slot": WHOLE,
            "unit": TEXT,
            **_gaps("unit_C"),
        },
    ),
    "events": Table(
        {
            "time_s": NUMBER,
            "kind": TEXT,
            "record": Column("whole", low=-1),  # −1: none
            "reason": REMARK,
            "action": REMARK,
        },
    ),
    "soaks": Table(
        {
            "time_s": NUMBER,
            "record": WHOLE,
            **_numbers("target_C", "seconds", "air_overshoot_K", "device_overshoot_K"),
        },
    ),
    "verdicts": Table(
        {
            "unit": TEXT,
            "slot": WHOLE,
            "refused": FLAG,
            "fault": REMARK,
            "reason": REMARK,
        },
        key=("unit",),
    ),
    "dwells": Table(
        {"unit": TEXT, "dwell": WHOLE, "time_s": NUMBER, **_numbers(*_OUT)},
        finite=(*_SD, *_FORCE, "outer_deg", "inner_deg", "unit_C", "chamber_C"),
        key=("unit", "dwell"),
    ),
    "coefficients": Table(
        {
            "unit": TEXT,
            "axis": _one_of(*AXES, "*"),
            "effect": TEXT,
            "name": TEXT,
            **_numbers("value", "standard_error"),
            "unit_text": REMARK,
        },
        key=("unit", "axis", "effect", "name"),
    ),
    "covariance": Table(
        {
            "unit": TEXT,
            "axis": _one_of(*AXES),
            "row": WHOLE,
            "column": WHOLE,
            "value": NUMBER,
        },
        key=("unit", "axis", "row", "column"),
    ),
    "residuals": Table(
        {
            "unit": TEXT,
            "dwell": WHOLE,
            "axis": _one_of(*AXES, "norm"),
            "pose": TEXT,
            **_numbers("force_g", "residual_ug", "standard_error_ug", "expected_ug"),
            **_gaps("unit_C"),
        },
        key=("unit", "dwell", "axis"),
    ),
    "predictions": Table(
        {
            "unit": TEXT,
            "axis": _one_of(*AXES),
            "dwell": WHOLE,
            "other": WHOLE,
            "covariance_ug2": NUMBER,
        },
        key=("unit", "axis", "dwell", "other"),
    ),
    "wander": Table(
        {
            "unit": TEXT,
            "axis": _one_of(*AXES),
            "method": _one_of("wander", "birge"),
            **_numbers("white_ug", "flicker_ug", "walk_ug", "lack_of_fit"),
            "dof": WHOLE,
        },
        key=("unit", "axis"),
    ),
    "verification": Table(
        {
            "unit": TEXT,
            "dwell": WHOLE,
            "pose": TEXT,
            **_numbers("norm_g", "error_ug", "uncertainty_ug", "error_x_ug", "error_y_ug", "error_z_ug"),
        },
        key=("unit", "dwell"),
    ),
    "verification_poses": Table(
        {"unit": TEXT, "pose": TEXT, "dwells": Column("whole", low=1), **_numbers("error_ug", "uncertainty_ug")},
        key=("unit", "pose"),
    ),
    "allan": Table(
        {
            "unit": TEXT,
            "axis": _one_of(*AXES),
            **_numbers("tau_s", "deviation_ug", "low_ug", "high_ug"),
            **_gaps("fitted_ug"),
        },
        key=("unit", "axis", "tau_s"),
    ),
    "noise": Table(
        {
            "unit": TEXT,
            "axis": _one_of(*AXES),
            "term": TEXT,
            **_gaps("value", "low", "high"),
            "identified": FLAG,
            "unit_text": REMARK,
        },
        key=("unit", "axis", "term"),
    ),
    "procedure_points": Table(
        {
            **_texts("unit", "procedure", "axis", "series"),
            **dict.fromkeys(("number", "point"), WHOLE),
            **_gaps("setting", "value", "uncertainty"),
        },
        key=("number", "unit", "axis", "series", "point"),
    ),
    "procedure_figures": Table(
        {
            **_texts("unit", "procedure", "figure", "axis"),
            "number": WHOLE,
            **_gaps("value", "uncertainty", "low", "high"),
            "identified": FLAG,
            "unit_text": TEXT,
            "note": REMARK,
        },
        key=("number", "unit", "figure", "axis"),
    ),
    "procedure_findings": Table({"unit": REMARK, "procedure": TEXT, "number": WHOLE, "subject": TEXT, "text": TEXT}),
    "figures": Table(
        {
            "unit": TEXT,
            "figure": TEXT,
            **_numbers("value", "uncertainty"),
            "limit": Column("number", missing=True),
            "unit_text": REMARK,
            "outcome": TEXT,
            "rule": REMARK,
        },
        key=("unit", "figure"),
    ),
    # one row per unit, quantity and contribution
    "budget": Table(
        {
            **_texts("unit", "quantity", "axis", "contribution", "type", "distribution", "scope"),
            **dict.fromkeys(("unit_text", "input_unit", "source"), REMARK),
            **_numbers("u", "share", "divisor", "stated"),
            **_gaps("dof", "sensitivity", "visible"),
        },
        key=("unit", "quantity", "axis", "contribution"),
    ),
    "uncertainties": Table(
        {
            **_texts("unit", "quantity", "axis", "frame"),
            **dict.fromkeys(("unit_text", "largest"), REMARK),
            **_numbers("value", "u_a", "u_b", "u", "k", "expanded"),
            **_gaps("dof", "shown", "unseen"),
        },
        key=("unit", "quantity", "axis"),
    ),
    # of the coefficients of all axes in one vector, x before y before z, lower triangle
    "budget_covariance": Table(
        {"unit": TEXT, "row": WHOLE, "column": WHOLE, "value": NUMBER},
        key=("unit", "row", "column"),
    ),
    # risks of the decisions over the production that a lot stands for
    "lot_risks": Table(
        {
            "figure": TEXT,
            "unit_text": REMARK,
            "units": Column("whole", low=1),
            **_numbers("mean", "u", "limit", "accept"),
            **_gaps("process", "pfa", "pfr", "accepted", "largest_pfa"),
        },
        key=("figure",),
    ),
    "grades": Table(
        {
            "unit": TEXT,
            "slot": WHOLE,
            "outcome": _one_of(*OUTCOMES),
            "grade": REMARK,
            "reasons": REMARK,
            "rule": REMARK,
        },
        key=("unit",),
    ),
}
