"""Lineage: from a certificate to the raw samples and back, with author, place, time, code, libraries, station and standards."""

from pipelines.lineage.graph import Activity, Graph, Node
from pipelines.lineage.targets import Lineage, lineage

__all__ = ["Activity", "Graph", "Lineage", "Node", "lineage"]
