"""Allan deviation, another statistic or spectrum of a record as a picture, and as one HTML page with its tables."""

from typing import Any, cast

import numpy as np

from pipelines.drawing.chart import SEVERAL, Chart, Plot, PlotAxis, Role, Trace, measured_curve
from pipelines.drawing.vector import still, svg_text
from pipelines.report.numbers import significant
from pipelines.report.templates import template
from schemas.units import AXES

PER_DECADE = 40


def noise_chart(document: dict[str, Any]) -> Chart:
    """The chart of a document of ``allan`` or ``psd``."""
    return _spectra(document) if "spectra" in document else _curves(document)


def noise_page(document: dict[str, Any]) -> str:
    """One HTML page that needs no other file."""
    name = document.get("statistic_name", "")
    title = "Power spectral density" if "spectra" in document else name[:1].upper() + name[1:]
    return template("noise.html").render(
        title=title,
        document={"terms": [], "spectra": [], "notes": [], **document},
        unit=document["unit"] or "unit",
        picture=still(svg_text(noise_chart(document))),
        number=significant,
    )


def _role(name: str, number: int) -> Role:
    """The colour of a channel: that of the axis in its name."""
    axis = name[-1:].lower()
    return cast("Role", axis) if axis in AXES else SEVERAL[number % len(SEVERAL)]


def _curves(document: dict[str, Any]) -> Chart:
    """Every curve with its intervals, and the mixture of terms that explains it."""
    traces: list[Trace] = []
    for k, curve in enumerate(document["curves"]):
        tau, deviation, low, high = (np.array(curve[key], dtype=float) for key in ("tau_s", "deviation", "low", "high"))
        channel, fitted = curve["channel"], curve["fitted"]
        # of many units the colour tells the axis alone, and so does the legend
        shown = f"axis {channel[-1:]}" if len(document["curves"]) > len(SEVERAL) and channel[-1:] in AXES else channel
        names = f"{channel}: interval", shown, f"{channel}: terms"
        terms = None if fitted is None else np.array(fitted)
        traces += measured_curve(names, _role(channel, k), tau, deviation, (low, high), terms)
    name = document["statistic_name"]
    label = f"{name} / {document['deviation_unit'] or 'unit of the record'}"
    axes = PlotAxis("averaging time τ / s", log=True), PlotAxis(label, log=True)
    return Chart(name[:1].upper() + name[1:], (Plot(document["source"], *axes, tuple(traces)),), height=460)


def _spectra(document: dict[str, Any]) -> Chart:
    lines = np.array(document["frequency_hz"])[1:]
    # so many points for each decade: a record of a million samples would be drawn as a black bar
    cell = np.floor(PER_DECADE * np.log10(lines / lines[0])).astype(int)
    _, group = np.unique(cell, return_inverse=True)
    count = np.bincount(group)
    frequency = np.exp(np.bincount(group, weights=np.log(lines)) / count)
    traces: list[Trace] = []
    for k, row in enumerate(document["spectra"]):
        amplitude = np.sqrt(np.bincount(group, weights=np.array(row["density"])[1:]) / count)
        traces.append(Trace(row["channel"], frequency, amplitude, "line", _role(row["channel"], k), width=1.2))
    label = f"noise density / {document['unit'] or 'unit'}/√Hz, one-sided"
    axes = PlotAxis("frequency / Hz", log=True), PlotAxis(label, log=True)
    return Chart("Power spectral density", (Plot(document["source"], *axes, tuple(traces)),), height=460)
