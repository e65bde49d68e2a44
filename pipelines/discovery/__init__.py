"""Discoveries in an archive: scores of its runs, attributes of units and runs, nightly evidence, names and pages."""
