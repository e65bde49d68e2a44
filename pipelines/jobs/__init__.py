"""Jobs: recipe, limits, station and lot of one run, and the files that say so."""
