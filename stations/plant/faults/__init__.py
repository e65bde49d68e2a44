"""Faults of the simulated station, of its wires, devices and units; each kind is a class, injected by its name."""
