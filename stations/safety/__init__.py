"""Safety of a station and validity of its data: conditions that pause a run, leases, the watchdog's client, the safe state."""
