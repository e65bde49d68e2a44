"""White noise of each soak over temperature, with the fitted curve."""

import numpy as np
import pandas as pd

from inertial.distributions import NORMAL_95
from inertial.noise.over_temperature import density_curve
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace
from pipelines.report.context import UnitContext
from pipelines.report.interactive import figure_of
from pipelines.report.numbers import significant, with_uncertainty
from pipelines.report.templates import fill
from pipelines.tables.frames import rows_of
from schemas.units import axes_among

ORDER = 42
TITLE = "Noise over temperature"
POINTS = 41
TEMPLATE = """\
<table>
<tr><th>axis</th><th class="n">from</th><th class="n">to</th><th class="n">ratio of N</th><th class="n">U</th><th>with temperature</th></tr>
{% for line in lines %}
<tr><td>{{ line.axis }}</td><td class="n">{{ line.cold }} °C</td><td class="n">{{ line.hot }} °C</td><td class="n">{{ line.ratio }}</td><td class="n">{{ line.spread }}</td><td>{{ line.verdict }}</td></tr>
{% endfor %}
</table>
{{ picture | safe }}
<p class="note">N, velocity random walk of the dwells of each soak (two-sided, IEEE 952). U: 95 %. {{ judged }}</p>
"""


def render(unit: UnitContext) -> str | None:
    """One line per axis and the chart; None where the soaks were not apart in temperature, and for runs of earlier versions."""
    rows = unit.tables.get("noise_temperature")
    if rows is None or rows.empty:
        return None
    p = float(rows["p_value"].iloc[0])
    judged = (
        f"Probability of such differences of equal soaks, over the axes of the lot: p = {p:.1g}."
        if np.isfinite(p)
        else "The test over the axes of the lot was not made: two axes with all soaks are needed."
    )
    return fill(
        TEMPLATE,
        lines=[_line(row) for row in rows_of(rows)],
        picture=figure_of(chart(unit.tables["soak_noise"])),
        judged=judged,
    )


def _line(row: dict[str, float]) -> dict[str, str]:
    ratio, spread = with_uncertainty(row["ratio"], row["high"] - row["ratio"])
    ends = {name: significant(row[f"{name}_C"]) for name in ("cold", "hot")}
    return {"axis": str(row["axis"]), **ends, "ratio": ratio, "spread": spread, "verdict": str(row["verdict"])}


def chart(soaks: pd.DataFrame) -> Chart:
    """Density of each soak of one unit with its interval, and the curve of each axis with its band of 95 %."""
    traces: list[Trace] = []
    known = soaks[soaks["identified"]]
    for axis in axes_among(known["axis"]):
        of_axis = known[known["axis"] == axis]
        at, value, low, high = (of_axis[c].to_numpy(dtype=float) for c in ("temperature_C", "value", "low", "high"))
        traces.append(Trace(f"axis {axis}", at, value, "points", axis, error=0.5 * (high - low)))
        curve = density_curve(at, value, (high - low) / (2.0 * NORMAL_95))
        if curve is not None:
            along = np.linspace(at.min(), at.max(), POINTS)
            fitted, u = curve.at(along)
            half = NORMAL_95 * u
            traces.append(
                Trace(f"curve {axis}, 95 %", along, fitted - half, "band", axis, high=fitted + half, legend=False)
            )
            traces.append(Trace(f"curve {axis}", along, fitted, "line", axis, width=1.0, legend=False))
    axes = PlotAxis("temperature of the device / °C"), PlotAxis("N / µg/√Hz")
    return Chart(TITLE, (Plot("", *axes, tuple(traces)),))
