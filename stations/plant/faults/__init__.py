"""Trouble for the simulated station: what a plant floor does to wires and devices, injectable by name."""
