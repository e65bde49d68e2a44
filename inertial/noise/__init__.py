"""Stochastic errors of an output: Allan deviation, its terms, spectrum and the drift filter."""
