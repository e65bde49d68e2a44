"""Fits: least squares of a model over a lot, and the closed forms of special plans."""
