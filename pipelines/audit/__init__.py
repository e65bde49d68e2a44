"""The audit: what drifts, what is due, which station moved, and how the population stands; from the archive alone."""
