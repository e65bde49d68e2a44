"""How many dwells have a model of the noise between them."""

LONGEST = 1500
"""Largest number of dwells with a model of wander: its covariance must fit into memory. Long runs are averaged before."""
