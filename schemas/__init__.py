"""What crosses a boundary: tables, recipes, limits, station and model files, and the errors by who must act."""
