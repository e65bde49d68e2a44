"""The production adapters of the devices of a station, for every link; they do not depend on the simulated plant."""
