"""The production adapters: what a station's devices do, on whatever link; they know nothing of the simulated plant."""
