"""Lineage: from a certificate to the raw samples and back, with who, where, when, code, libraries, station and standards."""

from pipelines.lineage.graph import Graph, Node, Step
from pipelines.lineage.targets import Lineage, lineage

__all__ = ["Graph", "Lineage", "Node", "Step", "lineage"]
