"""What keeps a station safe and its data clean: conditions that pause a run, leases, the watchdog, the safe state."""
