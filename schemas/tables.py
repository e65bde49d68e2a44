"""The tables that cross a stage boundary: columns, types and what every row must satisfy.

``check(name, frame)`` gives the frame back or raises :class:`DataRejected` with unit, row, value and what is needed.
Every table has a schema version that travels with its file.
"""

from schemas import version
from schemas.table import Table, any_text, flag, gaps, number, numbers, text, whole
from schemas.units import AXES

VERSION = version.VERSION
KINDS = ("dwell", "verification", "allan", "procedure")
OUTPUT_UNITS = ("V", "LSB", "g", "m/s^2")
OUTCOMES = ("pass", "fail", "refused")
ADEQUATE, NOT_ADEQUATE, NOT_JUDGED = VERDICTS = ("adequate", "not adequate", "not judged")


_OUT = ("out_x", "out_y", "out_z")
_SD = ("sd_x", "sd_y", "sd_z")
_FORCE = ("force_x", "force_y", "force_z")
_PLACE = {"unit": text(), "slot": whole(), "record": whole(), "kind": text(*KINDS)}
_ANGLES = ("outer_deg", "inner_deg", "outer_command_deg", "inner_command_deg")
_SURROUNDINGS = ("chamber_C", "unit_C", "supply_V", "vibration_g", "since_move_s", "since_power_s")

TABLES: dict[str, Table] = {
    # Samples may hold NaN: what a device really sent is kept, and the validate stage refuses the unit.
    "samples": Table({**_PLACE, "time_s": number(), **gaps(AXES)}),
    "readings": Table(
        {
            **_PLACE,
            "pose": text(),
            "soak": whole(),
            **gaps(_ANGLES),
            **gaps(_SURROUNDINGS),
            **numbers(("start_s", "duration_s", "rate_hz")),
            "n": whole(),
            "overflow": flag(),
            "status": text(),
            "out_unit": text(*OUTPUT_UNITS),
            "full_scale": number(low=0.0),
        },
        measured=(*_ANGLES, "chamber_C", "unit_C"),
        key=("unit", "record"),
        only_ok=True,
    ),
    "history": Table(
        {
            "time_s": number(),
            "chamber_C": number(),
            "slot": whole(),
            "unit": text(),
            **gaps(("unit_C",)),
        },
    ),
    "events": Table(
        {
            "time_s": number(),
            "kind": text(),
            "record": whole(-1),  # −1: none
            "reason": any_text(),
            "action": any_text(),
        },
    ),
    "soaks": Table(
        {
            "time_s": number(),
            "record": whole(),
            **numbers(("target_C", "seconds", "air_overshoot_K", "device_overshoot_K")),
        },
    ),
    "verdicts": Table(
        {
            "unit": text(),
            "slot": whole(),
            "refused": flag(),
            "fault": any_text(),
            "reason": any_text(),
        },
        key=("unit",),
    ),
    "dwells": Table(
        {"unit": text(), "dwell": whole(), "time_s": number()},
        measured=(*_OUT, *_SD, *_FORCE, "outer_deg", "inner_deg", "unit_C", "chamber_C"),
        key=("unit", "dwell"),
    ),
    "coefficients": Table(
        {
            "unit": text(),
            "axis": text(*AXES, "*"),
            "effect": text(),
            "name": text(),
            **numbers(("value", "standard_error")),
            "unit_text": any_text(),
        },
        key=("unit", "axis", "effect", "name"),
    ),
    "covariance": Table(
        {
            "unit": text(),
            "axis": text(*AXES),
            "row": whole(),
            "column": whole(),
            "value": number(),
        },
        key=("unit", "axis", "row", "column"),
    ),
    "residuals": Table(
        {
            "unit": text(),
            "dwell": whole(),
            "axis": text(*AXES, "norm"),
            "pose": text(),
            **numbers(("force_g", "residual_ug", "standard_error_ug", "expected_ug")),
            **gaps(("unit_C",)),
        },
        key=("unit", "dwell", "axis"),
    ),
    "predictions": Table(
        {
            "unit": text(),
            "axis": text(*AXES),
            "dwell": whole(),
            "other": whole(),
            "covariance_ug2": number(),
        },
        key=("unit", "axis", "dwell", "other"),
    ),
    "wander": Table(
        {
            "unit": text(),
            "axis": text(*AXES),
            "method": text("wander", "birge"),
            **numbers(("white_ug", "flicker_ug", "walk_ug", "lack_of_fit")),
            "dof": whole(),
        },
        key=("unit", "axis"),
    ),
    "verification": Table(
        {
            "unit": text(),
            "dwell": whole(),
            "pose": text(),
            **numbers(("norm_g", "error_ug", "uncertainty_ug")),
        },
        measured=("error_x_ug", "error_y_ug", "error_z_ug"),
        key=("unit", "dwell"),
    ),
    "verification_poses": Table(
        {"unit": text(), "pose": text(), "dwells": whole(1), **numbers(("error_ug", "uncertainty_ug"))},
        key=("unit", "pose"),
    ),
    "allan": Table(
        {
            "unit": text(),
            "axis": text(*AXES),
            **numbers(("tau_s", "deviation_ug", "low_ug", "high_ug")),
            **gaps(("fitted_ug",)),
        },
        key=("unit", "axis", "tau_s"),
    ),
    "noise": Table(
        {
            "unit": text(),
            "axis": text(*AXES),
            "term": text(),
            **gaps(("value", "low", "high")),
            "identified": flag(),
            "unit_text": any_text(),
        },
        key=("unit", "axis", "term"),
    ),
    "procedure_points": Table(
        {
            **{name: text() for name in ("unit", "procedure", "axis", "series")},
            **{name: whole() for name in ("number", "point")},
            **gaps(("setting", "value", "uncertainty")),
        },
        key=("number", "unit", "axis", "series", "point"),
    ),
    "procedure_figures": Table(
        {
            **{name: text() for name in ("unit", "procedure", "figure", "axis")},
            "number": whole(),
            **gaps(("value", "uncertainty", "low", "high")),
            "identified": flag(),
            "unit_text": text(),
            "note": any_text(),
        },
        key=("number", "unit", "figure", "axis"),
    ),
    "procedure_findings": Table(
        {"unit": any_text(), "procedure": text(), "number": whole(), "subject": text(), "text": text()}
    ),
    "figures": Table(
        {
            "unit": text(),
            "figure": text(),
            **numbers(("value", "uncertainty")),
            "limit": number(missing=True),
            "unit_text": any_text(),
            "outcome": text(),
            "rule": any_text(),
        },
        key=("unit", "figure"),
    ),
    # one row per unit, quantity and contribution
    "budget": Table(
        {
            **{name: text() for name in ("unit", "quantity", "axis", "contribution", "type", "distribution", "scope")},
            **{name: any_text() for name in ("unit_text", "input_unit", "source")},
            **numbers(("u", "share", "divisor", "stated")),
            **gaps(("dof", "sensitivity", "visible")),
        },
        key=("unit", "quantity", "axis", "contribution"),
    ),
    "uncertainties": Table(
        {
            **{name: text() for name in ("unit", "quantity", "axis", "frame")},
            **{name: any_text() for name in ("unit_text", "largest")},
            **numbers(("value", "u_a", "u_b", "u", "k", "expanded")),
            **gaps(("dof", "shown", "unseen")),
        },
        key=("unit", "quantity", "axis"),
    ),
    # of the coefficients of all axes in one vector, x before y before z, lower triangle
    "budget_covariance": Table(
        {"unit": text(), "row": whole(), "column": whole(), "value": number()},
        key=("unit", "row", "column"),
    ),
    # on the model of the run: the effects of the fit; one row, none without a model
    "verdict": Table(
        {
            "model": text(),
            "verdict": text(*VERDICTS),
            **{name: any_text() for name in ("reason", "faulty")},
            **gaps(("rms_ug", "floor_ug", "p_value")),
            "named": flag(),
            "units": whole(),
        },
        key=("model",),
    ),
    # risks of the decisions over the production that a lot stands for
    "lot_risks": Table(
        {
            "figure": text(),
            "unit_text": any_text(),
            "units": whole(1),
            **numbers(("mean", "u", "limit", "accept")),
            **gaps(("process", "pfa", "pfr", "accepted", "largest_pfa")),
        },
        key=("figure",),
    ),
    "grades": Table(
        {
            "unit": text(),
            "slot": whole(),
            "outcome": text(*OUTCOMES),
            "grade": any_text(),
            "reasons": any_text(),
            "rule": any_text(),
        },
        key=("unit",),
    ),
}
