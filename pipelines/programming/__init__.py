"""Writing of coefficients into the memory of devices, and their verification there."""
