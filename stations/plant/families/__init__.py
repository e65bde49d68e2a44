"""Simulated controllers, one module per family: its function ``simulated`` makes the registers of a controller."""
