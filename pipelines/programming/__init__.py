"""Writing of coefficients into the memory of devices, and the proof that they are there."""
