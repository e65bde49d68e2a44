"""Simulated controllers, one module per family: ``simulated`` puts the registers of the family in front of the world."""
