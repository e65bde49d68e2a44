"""The simulated station: physics behind a Modbus TCP server. Only :mod:`stations.opening` and tests import it."""
