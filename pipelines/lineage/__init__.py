"""Lineage: from a certificate to the raw samples and back, with author, place, time, code, libraries, station and standards."""

from pipelines.lineage.graph import Graph, Node, ProvActivity
from pipelines.lineage.targets import Lineage, lineage

__all__ = ["Graph", "Lineage", "Node", "ProvActivity", "lineage"]
