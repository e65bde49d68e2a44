"""Limits of the servers of the product: connections, time-outs, sizes of bodies."""
