"""Charts as plain descriptions, drawn by Plotly in a page, as SVG or PNG without a browser, and written as CSV."""

from pipelines.report.charts.chart import Chart, ColourScale, Plot, PlotAxis, Trace
from pipelines.report.charts.csv_rows import csv_text
from pipelines.report.charts.plotly_figure import plotly_figure
from pipelines.report.charts.vector import svg_text

__all__ = ["Chart", "ColourScale", "Plot", "PlotAxis", "Trace", "csv_text", "plotly_figure", "svg_text"]
