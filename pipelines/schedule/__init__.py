"""Schedule: the steps of a recipe and the time that they take."""
