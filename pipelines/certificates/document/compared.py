"""The part of a certificate that states results by comparison: sensitivity over frequency, transverse sensitivity, shocks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from pipelines.archive import Run
from pipelines.certificates.comparisons import Comparisons
from pipelines.certificates.document import content
from pipelines.certificates.stated_budget import Row
from pipelines.procedures import PROCEDURES
from pipelines.stages.uncertainty.compared import compared_quantity
from pipelines.tables.frames import rows_of

QUANTITIES = {
    "reference_sensitivity": "sensitivity at the reference frequency",
    "transverse_sensitivity": "largest transverse sensitivity, of the sensitivity on the axis",
    "transverse_direction": "direction of the largest transverse sensitivity",
    "vibration_rectification": "vibration rectification",
    "shock_sensitivity": "sensitivity to shocks, departure from the scale that it is compared with",
    "shock_undershoot": "undershoot after the shock beyond that of the reference, of the peak",
    "shock_zero_shift": "output at the end of the record minus the baseline, of the peak",
    "shock_duration": "duration of the pulse, half sine",
    "shock_return": "return to rest after the pulse, within 2 % of the peak",
    "shock_bias_shift": "bias after the shocks minus before",
}
BUDGETS = ("reference_sensitivity", "transverse_sensitivity", "vibration_rectification", "shock_sensitivity")
"""Results whose budget a certificate prints; for a transfer function also the budget at its highest frequency."""
AMPLITUDES = {"sweep": "g peak", "random_vibration": "g rms", "transverse": "g peak"}


@dataclass
class ComparedContent:
    """The parts of a certificate that come from the comparisons of a unit.

    budgets : quantities of the tables of the budget whose contributions are printed, with their words
    """

    methods: list[str] = field(default_factory=list[str])
    conditions: list[content.Condition] = field(default_factory=list[content.Condition])
    results: list[content.Result] = field(default_factory=list[content.Result])
    responses: list[content.Response] = field(default_factory=list[content.Response])
    budgets: dict[str, str] = field(default_factory=dict[str, str])
    left_out: list[str] = field(default_factory=list[str])


def compared_content(run: Run, unit: str, sums: Sequence[Row]) -> ComparedContent:
    """The comparisons of a unit that can be certified, and in ``left_out`` the others with the reason.

    Parameters
    ----------
    sums : rows of ``uncertainties`` of the unit
    """
    made, comparisons = ComparedContent(), Comparisons(run)
    made.left_out = [f"Not part of this certificate: {why}." for why in comparisons.reasons(unit).values() if why]
    known = {(str(row["quantity"]), str(row["axis"])): row for row in sums}
    for number, rows in comparisons.results(unit).items():
        part = comparisons.parts[number]
        pairs = [(row, known[compared_quantity(row), str(row["axis"])]) for row in rows_of(rows)]
        for row, total in pairs:
            if row["quantity"] in QUANTITIES:
                made.results.append(_result(row, total))
            if row["quantity"] in BUDGETS:
                made.budgets[str(total["quantity"])] = _words(row)
        points = _points(run, unit, number)
        made.methods.append(_method(part, rows, points, run))
        made.conditions += _conditions(part, points)
        if any(row["quantity"] == "response_magnitude" for row, _ in pairs):
            made.responses.append(_response(part, pairs, points, _curve(run, unit, number, pairs)))
            highest = max(
                (row for row, _ in pairs if row["quantity"] == "response_magnitude"), key=lambda row: row["setting"]
            )
            made.budgets[compared_quantity(highest)] = _words(highest)
    return made


def _words(row: Row) -> str:
    text = QUANTITIES.get(str(row["quantity"]), "sensitivity")
    return f"{text} ({row['setting']:.5g} Hz)" if np.isfinite(row["setting"]) else text


def _result(row: Row, total: Row) -> content.Result:
    numbers = {name: float(total[name]) for name in ("value", "expanded", "k")}
    dof = float(total["dof"]) if np.isfinite(total["dof"]) else None
    return content.Result(quantity=_words(row), axis=str(row["axis"]), unit=str(row["unit_text"]), dof=dof, **numbers)


def _points(run: Run, unit: str, number: int) -> pd.DataFrame:
    points = run.table("procedure_points")
    rows = points[(points["unit"] == unit) & (points["number"] == number)]
    return rows[rows["series"].isin(["response", "across", "reference"]) & np.isfinite(rows["value"])]


def _method(part: Any, rows: pd.DataFrame, points: pd.DataFrame, run: Run) -> str:
    procedure, axis = PROCEDURES[part.kind], str(rows["axis"].iloc[0])
    settings = rows.loc[rows["quantity"] == "response_magnitude", "setting"]
    if part.kind == "shock":
        where = f"{part.shocks * (2 if part.both_directions else 1)} half sines of {part.peak_g:g} g and {part.duration_ms:g} ms"
        stated = f"{part.scale:g} {run.table('readings')['out_unit'].iloc[0]}/g"
        where += f"; scale compared with: {'the coefficients' if len(run.table('coefficients')) else stated}"
    elif len(settings):
        where = f"{len(settings)} points from {settings.min():.4g} to {settings.max():.4g} Hz"
    else:
        where = f"{len(points)} angles at {part.frequency_hz:g} Hz"
    return f"{procedure.title} of axis {axis}: {where}; {procedure.source}."


def _conditions(part: Any, points: pd.DataFrame) -> list[content.Condition]:
    """The amplitudes at which a comparison was made."""
    if part.kind == "shock":
        amplitudes = points.loc[points["series"] == "reference", "value"].abs()
    else:
        amplitudes = points["level_g"].dropna() if "level_g" in points else pd.Series(dtype=float)
    levels = amplitudes.tolist() or [float(part.level_g)]
    name = f"amplitude of the {PROCEDURES[part.kind].title.lower()}, {AMPLITUDES.get(part.kind, 'g peak')}"
    return [content.Condition(name=name, low=float(min(levels)), high=float(max(levels)), unit="g")]


def _response(
    part: Any, pairs: Sequence[tuple[Row, Row]], points: pd.DataFrame, curve: content.Curve | None
) -> content.Response:
    """The transfer function as a table, in the order of frequency."""
    sizes, phases = (
        {int(row["point"]): (row, total) for row, total in pairs if row["quantity"] == name}
        for name in ("response_magnitude", "response_phase")
    )
    about = points.set_index("point")
    rows: list[content.ResponsePoint] = []
    for number, (row, size) in sorted(sizes.items(), key=lambda item: (item[1][0]["setting"], item[0])):
        phase = phases[number][1]
        rows.append(
            content.ResponsePoint(
                frequency_hz=float(row["setting"]),
                level_g=float(about["level_g"].loc[number]),
                temperature_C=float(about["temperature_C"].loc[number]),
                magnitude=float(size["value"]),
                magnitude_expanded=float(size["expanded"]),
                magnitude_k=float(size["k"]),
                phase_deg=float(phase["value"]),
                phase_expanded=float(phase["expanded"]),
                phase_k=float(phase["k"]),
            )
        )
    first = next(row for row, _ in pairs if row["quantity"] == "response_magnitude")
    title = f"{PROCEDURES[part.kind].title}, axis {first['axis']}"
    return content.Response(
        title=title, axis=str(first["axis"]), unit=str(first["unit_text"]), points=tuple(rows), curve=curve
    )


def _curve(run: Run, unit: str, number: int, pairs: Sequence[tuple[Row, Row]]) -> content.Curve | None:
    """The judged model of the points; None for a procedure without a model."""
    table = run.table("procedure_curves")
    rows = rows_of(table[(table["unit"] == unit) & (table["number"] == number) & (table["name"] != "")])
    if not rows:
        return None
    parameters = [_parameter(row, total) for row, total in pairs if str(row["quantity"]).startswith("curve_")]
    first = rows[0]
    return content.Curve(
        model=str(first["model"]), verdict=str(first["verdict"]), p_value=float(first["p_value"]),
        low_hz=float(first["low_hz"]), high_hz=float(first["high_hz"]), parameters=tuple(parameters),
        covariance=tuple(float(row["value"]) for row in rows),
    )  # fmt: skip


def _parameter(row: Mapping[str, Any], total: Row) -> content.CurveParameter:
    name = str(row["quantity"]).removeprefix("curve_")
    return content.CurveParameter(
        name=name, unit=str(row["unit_text"]), value=float(total["value"]), expanded=float(total["expanded"]),
        k=float(total["k"]),
    )  # fmt: skip
