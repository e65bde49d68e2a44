"""Capture: what the station measures, kept as it comes."""
