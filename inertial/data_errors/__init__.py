"""Errors of the data, not of the device: data faults, errors of handling, bad dwells."""
