"""Charts as plain descriptions, drawn by Plotly in a page, as SVG or PNG without a browser, and written as CSV."""

from pipelines.drawing.chart import Chart, ColourScale, Plot, PlotAxis, Trace
from pipelines.drawing.picture import csv_text
from pipelines.drawing.plotly_figure import plotly_figure
from pipelines.drawing.vector import still, svg_text

__all__ = ["Chart", "ColourScale", "Plot", "PlotAxis", "Trace", "csv_text", "plotly_figure", "still", "svg_text"]
