"""Links: what carries register reads and writes to a device."""
