"""Stages, archive, flows, reports and the command line of the calibration chain."""
