"""The demonstration: a hidden effect in the simulated station, found from the measurements, added to the model, and shown."""
