"""Allan deviation, another statistic or spectrum of a record as a picture, and as one HTML page with its tables."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pipelines.report.numbers import significant
from pipelines.report.plots import COLOURS, STYLE
from pipelines.report.templates import fill
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PER_DECADE = 40
ENDINGS = (".png", ".svg", ".pdf")
OTHERS = ("#cc79a7", "#e69f00", "#56b4e9", "#7a7a7a")
PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ title }} of {{ document.source }}</title>
<style>
{% include 'style.css' %}
</style>
</head>
<body>
<h1>{{ title }}</h1>
<p class="lead">{{ document.source }} · {{ document.samples }} samples at {{ number(document.rate_hz) }} Hz</p>
{{ picture | safe }}
{% if document.terms %}
<h2>Noise terms of the Allan deviation</h2>
<table>
<tr><th>channel</th><th>term</th><th>name</th><th class="n">value</th>
<th class="n">lower end</th><th class="n">upper end or limit</th><th>unit</th></tr>
{% for row in document.terms %}
<tr><td>{{ row.channel }}</td><td>{{ row.term }}</td><td>{{ row.name }}</td>
<td class="n">{{ number(row.value) if row.identified else "not identified" }}</td>
<td class="n">{{ number(row.low) if row.identified else "" }}</td>
<td class="n">{{ "" if row.identified else "≤ " }}{{ number(row.high) }}</td><td>{{ row.unit }}</td></tr>
{% endfor %}
</table>
<p class="note">Intervals and limits at {{ "%.0f" | format(100 * document.term_confidence) }} %;
bars of the curve at {{ "%.0f" | format(100 * document.confidence) }} %.</p>
{% endif %}
{% if document.spectra %}
<h2>Allan deviation from the density</h2>
<table>
<tr><th>channel</th><th class="n">τ / s</th>
<th class="n">σ from the density / {{ unit }}</th><th class="n">σ of the samples / {{ unit }}</th></tr>
{% for row in document.spectra %}{% for k in range(row.tau_s | length) %}
<tr><td>{{ row.channel }}</td><td class="n">{{ number(row.tau_s[k]) }}</td>
<td class="n">{{ number(row.deviation_from_density[k]) }}</td><td class="n">{{ number(row.deviation[k]) }}</td></tr>
{% endfor %}{% endfor %}
</table>
{% endif %}
{% for note in document.notes or [] %}<p class="note">{{ note }}</p>{% endfor %}
</body>
</html>
"""


def draw(document: dict[str, Any], ending: str) -> bytes:
    """The picture of a document of ``allan`` or ``psd`` in the format of a file's ending.

    Raises
    ------
    WrongUse
        The ending is none of a picture.
    """
    if ending.lower() not in ENDINGS:
        raise WrongUse(f"--plot: '{ending}' cannot be drawn; name a .png, .svg or .pdf file")
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8.6, 5.4), layout="constrained")
        place = figure.subplots()
        _spectra(place, document) if "spectra" in document else _curves(place, document)
        place.set(xscale="log", yscale="log")
        low, high = place.get_ylim()
        place.set_ylim(10.0 ** np.floor(np.log10(low)), 10.0 ** np.ceil(np.log10(high)))
        for axis in (place.xaxis, place.yaxis):
            axis.set_major_locator(LogLocator(base=10.0, subs=(1.0,)))
            axis.set_minor_locator(LogLocator(base=10.0, subs=(2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(_power))
            axis.set_minor_formatter(NullFormatter())
        place.grid(visible=True, which="major", color="#dcdcdc")
        place.set_title(document["source"], loc="left")
        if len(place.lines) + len(place.containers) <= 16:
            place.legend(frameon=False, fontsize=9)
        data = io.BytesIO()
        figure.savefig(
            data, format=ending.lower().lstrip("."), dpi=150, metadata={"Date": None} if ending == ".svg" else None
        )
    return data.getvalue()


def noise_page(document: dict[str, Any]) -> str:
    """One HTML page that needs no other file."""
    svg = draw(document, ".svg").decode()
    name = document.get("statistic_name", "")
    title = "Power spectral density" if "spectra" in document else name[:1].upper() + name[1:]
    return fill(
        PAGE,
        title=title,
        document={"terms": [], "spectra": [], "notes": [], **document},
        unit=document["unit"] or "unit",
        picture=svg[svg.index("<svg") :],
        number=significant,
    )


def _power(value: float, _: object) -> str:
    """A power of ten for an axis."""
    exponent = round(float(np.log10(value))) if value > 0.0 else 0
    return f"{value:g}" if -3 <= exponent <= 4 else f"1e{exponent}".replace("-", "−")


def _colour(name: str, place: int) -> str:
    return COLOURS.get(name[-1:].lower(), OTHERS[place % len(OTHERS)])


def _curves(place: Axes, document: dict[str, Any]) -> None:
    """Every curve with the intervals it has, and the mixture of terms that explains it."""
    for k, curve in enumerate(document["curves"]):
        tau, deviation = np.array(curve["tau_s"]), np.array(curve["deviation"])
        bars = np.abs(np.stack([deviation - curve["low"], np.array(curve["high"]) - deviation]))
        colour = _colour(curve["channel"], k)
        place.errorbar(
            tau,
            deviation,
            yerr=bars,
            fmt="o",
            color=colour,
            markersize=4,
            capsize=2,
            linewidth=1.0,
            label=curve["channel"],
        )
        if curve["fitted"] is not None:
            place.plot(tau, curve["fitted"], "-", color=colour, linewidth=1.4)
    unit = document["deviation_unit"] or "unit of the record"
    place.set(xlabel="averaging time τ / s", ylabel=f"{document['statistic_name']} / {unit}")


def _spectra(place: Axes, document: dict[str, Any]) -> None:
    """Noise density of every channel against frequency."""
    whole = np.array(document["frequency_hz"])[1:]
    # so many points for each decade: a record of a million samples would be drawn as a black bar
    cell = np.floor(PER_DECADE * np.log10(whole / whole[0])).astype(int)
    _, group = np.unique(cell, return_inverse=True)
    count = np.bincount(group)
    frequency = np.exp(np.bincount(group, weights=np.log(whole)) / count)
    for k, row in enumerate(document["spectra"]):
        amplitude = np.sqrt(np.bincount(group, weights=np.array(row["density"])[1:]) / count)
        place.plot(frequency, amplitude, "-", color=_colour(row["channel"], k), linewidth=1.2, label=row["channel"])
    place.set(xlabel="frequency / Hz", ylabel=f"noise density / {document['unit'] or 'unit'}/√Hz, one-sided")
