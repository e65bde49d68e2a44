"""Jobs: recipe, limits, station and lot of one run, and their files."""
