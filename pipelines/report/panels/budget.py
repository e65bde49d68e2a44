"""The uncertainty budget of the lot: references, shares, coverage by verification, and the risk of decisions."""

import numpy as np
import pandas as pd

from pipelines.drawing import still
from pipelines.report.budget_plots import shares_plot
from pipelines.report.context import ReportContext
from pipelines.report.numbers import significant
from pipelines.report.templates import fill
from pipelines.stages.figures import figure_label
from pipelines.stages.uncertainty.tables import LABELS
from pipelines.tables.frames import rows_of
from schemas.stated import SYMBOLS
from schemas.uncertainty import NEEDED

ORDER = 45
TITLE = "Uncertainty budget"
PICTURED = {
    ("bias", "z"): "bias, z",
    ("scale", "x"): "scale, x",
    ("orthogonality", "xy"): "angle between x and y",
    ("output", "norm"): "corrected output, magnitude",
    ("bias_error", "z"): "error of z for the user",
    ("bias_error_period", "z"): "error of z over the period",
}
NO_REFERENCE = dict.fromkeys(("what", "laboratory", "U", "k", "unit"), "")
TEMPLATE = """\
{% if not stated %}<p><b>Noise only:</b> the station states no [uncertainty]. Uncertainties are those of noise and fit; no grade above consumer, no certificate.</p>{% else %}
<p>Frame {{ frame }}; figures of the references by {{ source }}. Unit {{ unit }}: share of each contribution in u².</p>
{{ plot | safe }}
{% for name, rules in missing.items() %}<p class="note">not stated: {{ name }} (dominates {{ rules }})</p>{% endfor %}
{% if references %}<table>
<tr><th>reference standard</th><th>quantity</th><th>certificate</th><th>laboratory</th><th>due</th><th class="n">U</th><th class="n">k</th><th>unit</th></tr>
{% for one in references %}<tr><td>{{ one.id }}</td><td>{{ one.what }}</td><td>{{ one.certificate }}</td><td>{{ one.laboratory }}</td><td>{{ one.due }}</td><td class="n">{{ one.U or "" }}</td><td class="n">{{ one.k or "" }}</td><td>{{ one.unit or "" }}</td></tr>{% endfor %}
</table>{% endif %}
{% if seen %}<table>
<tr><th>unit</th><th>axis</th><th class="n">shown by verification<br><small>u of the references, µg</small></th><th class="n">error for the user<br><small>u of the references, µg</small></th><th class="n">not shown by verification<br><small>u, µg</small></th></tr>
{% for row in seen %}<tr><td>{{ row.unit }}</td><td>{{ row.axis }}</td><td class="n">{{ row.shown }}</td><td class="n">{{ row.met }}</td><td class="n">{{ row.unseen }}</td></tr>{% endfor %}
</table>
<p class="note">Verification on the same station repeats its errors: local gravity, thermometer, seat, supply and gain cancel in it and are known from the budget only. Worst axis of each unit; the part shown by verification is in the frame of the fixture.</p>{% endif %}
{% endif %}
{% if risks %}<table>
<tr><th>figure</th><th class="n">limit</th><th class="n">accepted up to<br><small>mean</small></th><th class="n">lot mean</th><th class="n">process σ</th><th class="n">u</th><th class="n">PFA, %</th><th class="n">PFR, %</th><th class="n">largest PFA of an accepted unit, %</th><th>unit</th></tr>
{% for row in risks %}<tr><td>{{ row.title }}</td>{% for name in ["limit", "accept", "mean", "process", "u", "pfa", "pfr", "largest"] %}<td class="n">{{ row[name] }}</td>{% endfor %}<td class="unit">{{ row.unit_text }}</td></tr>{% endfor %}
</table>
<p class="note">PFA, PFR: probability of false acceptance and false rejection over the production that the lot represents (JCGM 106, normal); –: fewer than three units.</p>{% endif %}
"""


def render(report: ReportContext) -> str:
    """The budget; a notice for runs without a budget, such as those of earlier versions."""
    sums, station = report.tables.get("uncertainties", pd.DataFrame()), report.about.get("station") or {}
    recipe = report.recipe
    entries = {**(station.get("uncertainty") or {}), **(recipe.get("uncertainty") or {})}
    missing = {name: rules for name, rules in NEEDED.items() if name not in {*entries, *report.not_needed}}
    first = str(sums["unit"].iloc[0]) if len(sums) else ""
    return fill(
        TEMPLATE,
        stated=bool(len(sums)),
        unit=first,
        frame=str(sums["frame"].iloc[0]) if len(sums) else "",
        source=str(entries.get("grade_source", "assumed")).replace("_", " "),
        plot=still(shares_plot(_shares(report.tables["budget"], first))) if len(sums) else "",
        missing=missing if len(sums) else {},
        references=[
            {**NO_REFERENCE, **reference, "unit": SYMBOLS.get(reference.get("unit") or "", "")}
            for reference in station.get("reference", [])
        ],
        seen=_seen(sums),
        risks=_risks(report.tables.get("lot_risks")),
    )


def _shares(budget: pd.DataFrame, unit: str) -> dict[str, dict[str, float]]:
    of_unit = budget[budget["unit"] == unit]
    shares: dict[str, dict[str, float]] = {}
    for (quantity, axis), title in PICTURED.items():
        rows = of_unit[(of_unit["quantity"] == quantity) & (of_unit["axis"] == axis)]
        if len(rows):
            shares[title] = {LABELS[str(r["contribution"])]: float(r["share"]) for r in rows_of(rows)}
    return shares


def _seen(sums: pd.DataFrame) -> list[dict[str, str]]:
    rows = sums[sums["quantity"] == "bias_error"] if len(sums) else sums
    if len(rows):  # the worst axis of each unit
        rows = rows.loc[rows.groupby("unit", sort=False)["u_b"].idxmax()]
    columns = {"shown": "shown", "met": "u_b", "unseen": "unseen"}
    return [
        {"unit": str(row["unit"]), "axis": str(row["axis"])}
        | {name: significant(row[column]) for name, column in columns.items()}
        for row in rows_of(rows)
    ]


def _risks(table: pd.DataFrame | None) -> list[dict[str, str]]:
    if table is None:
        return []
    return [
        {
            "title": figure_label(row["figure"]),
            **{name: significant(row[name]) for name in ("limit", "accept", "mean", "process", "u")},
            **{name: _percent(row[name]) for name in ("pfa", "pfr")},
            "largest": _percent(row["largest_pfa"]),
            "unit_text": "" if row["unit_text"] == "1" else row["unit_text"],
        }
        for row in rows_of(table)
    ]


def _percent(value: float) -> str:
    if not np.isfinite(value):
        return "–"
    return "< 0.01" if 0.0 <= value < 1e-4 else f"{100.0 * value:.2g}"
