"""Dwells in unknown poses: their fit, verification and budget from the norm of gravity."""
