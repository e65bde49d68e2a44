"""Capture: the measurement at the station, with each record stored as soon as it is measured."""
