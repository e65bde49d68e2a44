"""The demonstration: a hidden effect in the simulated station is found from the measurements and added to the model."""
