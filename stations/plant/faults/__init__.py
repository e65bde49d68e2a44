"""Trouble for the simulated station: what a plant floor does to wires and devices, one kind a file, injectable by name."""
