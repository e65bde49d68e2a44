"""Imported tables: raw records and dwells in the exchange format."""
