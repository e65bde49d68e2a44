"""Plans: visibility of effects, expected errors and station time of a recipe; search for a quicker recipe."""
