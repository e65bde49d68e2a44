"""Improvement of a model: diagnosis, choice of effects, new versions, and the error of each version."""
