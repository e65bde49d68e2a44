"""Plans: what a recipe can see and costs, and the cheapest recipe for errors that are required."""
