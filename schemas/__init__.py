"""Data at the boundaries: tables, recipes, limits, station and model files, and the errors by who must act."""
