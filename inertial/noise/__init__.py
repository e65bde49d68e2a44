"""Stochastic errors of an output: Allan deviation, its terms, spectrum, generators and the drift filter."""
