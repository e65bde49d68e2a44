"""The demonstration: an effect is hidden, found from the measurements alone, added, and revealed."""
