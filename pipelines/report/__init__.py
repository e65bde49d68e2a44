"""The report for people: one HTML file per run that opens without a network."""

from pipelines.report.page import render

__all__ = ["render"]
