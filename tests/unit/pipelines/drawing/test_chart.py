"""One description of a chart, drawn three ways: the same points, labels and units in each."""

import base64
import csv
import io
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pipelines.drawing import Chart, ColourScale, Plot, PlotAxis, Trace, csv_text, plotly_figure, svg_text
from pipelines.drawing.chart import ROLES, density
from pipelines.drawing.mollweide import project, sphere
from pipelines.drawing.picture import picture
from pipelines.report.run_pictures import samples_chart


def chart() -> Chart:
    x = np.array([0.0, 1.0, 2.0])
    traces = (
        Trace("measured", x, 2.0 * x, texts=("a", "b", "c"), picks=("U:0", "U:1", "U:2"), colour=x - 1.0),
        Trace("band", x, x - 1.0, "band", high=x + 1.0),
        Trace("line", x, x, "line", "limit", dashed=True),
        Trace("bars", x, x, "bars"),
    )
    plots = (Plot("one", PlotAxis("time / s"), PlotAxis("residual / µg"), traces), sphere("two", ()))
    return Chart("a chart", plots, 2, ColourScale("mean / µg", -1.0, 1.0))


def unpacked(values: dict[str, str]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(values["bdata"]), dtype="<" + values["dtype"])


def test_the_numbers_of_a_figure_are_those_of_its_csv_and_its_labels_those_of_its_pictures() -> None:
    figure = plotly_figure(chart())
    rows = list(csv.DictReader(io.StringIO(csv_text(chart()))))
    own = [row for row in rows if row["series"] == "measured"]
    measured = next(one for one in figure["data"] if one["name"] == "measured")
    assert unpacked(measured["x"]).tolist() == [float(row["x"]) for row in own]
    assert unpacked(measured["y"]).tolist() == [float(row["y"]) for row in own]
    assert measured["customdata"] == [row["pick"] for row in own]
    assert {row["x_label"] for row in own} == {figure["layout"]["xaxis"]["title"]["text"]} == {"time / s"}
    text = svg_text(chart())
    assert [one for one in ("time / s", "residual / µg", "mean / µg", "one", "measured") if one not in text] == []
    assert picture(chart(), ".png")[:4] == b"\x89PNG"
    config = figure["config"]  # nothing leaves the page
    assert (config["showSendToCloud"], config["plotlyServerURL"], config["displaylogo"]) == (False, "", False)
    assert "geo" not in str(figure["layout"])


def test_the_note_of_a_chart_stands_below_its_plots() -> None:
    plain, noted = chart(), replace(chart(), note="3 of 5 are <not> drawn")
    before, after = plotly_figure(plain)["layout"], plotly_figure(noted)["layout"]
    assert after["height"] - before["height"] == after["margin"]["b"] - before["margin"]["b"] > 0
    assert after["annotations"][-1]["text"] == "3 of 5 are &lt;not&gt; drawn"
    assert ">3 of 5 are &lt;not&gt; drawn</text>" in svg_text(noted)


def test_names_become_no_markup_and_no_formula_of_a_spreadsheet() -> None:
    bad = Trace("<b>=cmd()</b>", np.zeros(1), np.zeros(1), texts=("<a href='javascript:1'>",))
    plot = Plot("=1+1", PlotAxis("<i>"), PlotAxis("y"), (bad,))
    figure = plotly_figure(Chart("c", (plot,)))
    assert not re.search(r"<(?!b>|/b>|extra>|/extra>)", str(figure))
    assert "<b>=cmd" not in str(figure)
    assert "'=1+1" in csv_text(Chart("c", (plot,)))
    serial = "S" * 64  # a long one is cut in the legend only
    plot = Plot("", PlotAxis("x"), PlotAxis("y"), (Trace(serial, np.zeros(1), np.zeros(1)),))
    (trace,) = plotly_figure(Chart("c", (plot,)))["data"]
    assert len(trace["name"]) < 32
    assert trace["legendgroup"] == serial


def test_a_crowd_loses_no_point_and_mollweide_keeps_areas(rng: np.random.Generator) -> None:
    """Points even on the sphere are even on the ellipse: the share of any part of its area (Snyder, USGS 1395, p. 249)."""
    x, y = rng.normal(size=(2, 5000))
    y[7] = np.nan
    assert density(x, y).counts.sum() == 4999
    x, y = project(rng.normal(size=(200_000, 3)))
    assert np.max((x / 2.0) ** 2 + y**2) <= 1.0 + 1e-9
    assert np.mean((x / 2.0) ** 2 + y**2 < 0.25) == pytest.approx(0.25, abs=0.004)
    assert np.mean((x > 0.0) & (y > 0.0)) == pytest.approx(0.25, abs=0.004)


def test_samples_are_a_line_unless_one_beside_a_gap_would_be_hidden(rng: np.random.Generator) -> None:
    values = rng.normal(size=(100, 3))
    for style in ("line", "points"):
        table = pd.DataFrame(values, columns=["x", "y", "z"]).assign(time_s=np.arange(100) / 100.0)
        traces = [trace for plot in samples_chart(table, "a dwell", "g").plots for trace in plot.traces]
        assert [trace.style for trace in traces] == [style] * 3
        assert np.allclose(traces[0].y, values[:, 0] - np.nanmean(values[:, 0]), equal_nan=True)
        values[40:60:2] = np.nan


def test_one_colour_of_a_legend_means_one_thing() -> None:
    apart = ("x", "y", "z", "fourth", "before", "after", "muted", "ink", "good")
    assert len({ROLES[role] for role in apart}) == len(apart)


def test_on_narrow_screens_plots_stand_one_under_the_other_and_lines_names_and_spheres_fit() -> None:
    figure = plotly_figure(chart())
    wide, narrow = figure["layout"], figure["narrow"]
    assert wide["xaxis"]["domain"][1] < wide["xaxis2"]["domain"][0]
    assert narrow["xaxis"]["domain"] == narrow["xaxis2"]["domain"] == [0.0, 1.0]
    assert narrow["yaxis"]["domain"][0] > narrow["yaxis2"]["domain"][1]
    assert narrow["height"] > wide["height"] + chart().height
    assert "narrow" not in plotly_figure(replace(chart(), columns=1))
    axes = PlotAxis("a" * 30 + " b / µg", names=tuple(f"p{k}" for k in range(40))), PlotAxis("y")
    plot = Plot("", *axes, (Trace("", np.arange(40.0), np.arange(40.0)),))
    figure = plotly_figure(Chart("", (plot,), note="word " * 20))
    wide, narrow = figure["layout"], figure["narrow"]
    assert narrow["xaxis"]["title"]["text"].count("<br>") == 1 > wide["xaxis"]["title"]["text"].count("<br>")
    assert narrow["annotations"][0]["text"].count("<br>") > 1
    assert len(narrow["xaxis"]["tickvals"]) <= 14 < len(wide["xaxis"]["tickvals"])
    assert plotly_figure(Chart("", (sphere("", ()),), height=420))["narrow"]["height"] < 300
    assert "narrow" not in plotly_figure(Chart("", (replace(plot, x=PlotAxis("time / s")),)))


def named_bars(*names: str) -> Chart:
    """A low chart with a point above each name."""
    points = Trace("", np.arange(1.0 * len(names)), np.arange(1.0 * len(names)))
    return Chart("", (Plot("", PlotAxis("", names=names), PlotAxis("y"), (points,)),), height=200)


def test_names_are_turned_where_one_of_them_is_wider_than_its_place_and_stay_inside_the_picture() -> None:
    others = ["mean", "station", "date", "slot", "unit", "wafer", "operator", "supplier", "firmware", "batch"]
    assert "rotate(-38" not in svg_text(named_bars("season", *others))
    assert "rotate(-38" in svg_text(named_bars("own temperature coefficient", *others))
    text = svg_text(named_bars(*(f"effect_{'x' * 9}{k:02d}" for k in range(20))))
    height = float(re.search(r'viewBox="0 0 [\d.]+ ([\d.]+)"', text)[1])  # type: ignore[index]
    lowest = max(float(y) for y in re.findall(r"rotate\(-38 [\d.]+ ([\d.]+)\)", text))
    assert lowest + 14 * 6.9 * np.sin(np.radians(38.0)) < height
