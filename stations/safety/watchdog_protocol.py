"""What a run and its watchdog say to each other, a line each."""

READY = b"ready\n"  # the watchdog watches
BEAT = b"here\n"  # the run lives; the watchdog's answer that it does too
DONE = b"done\n"  # the run has left the station safe
