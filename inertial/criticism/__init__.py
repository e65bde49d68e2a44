"""Criticism of a model: its adequacy for the noise of the data, the drivers of its residual, missing effects."""
