"""The audit: drift, units that are due, stations that moved, and statistics of the population, from the archive alone."""
