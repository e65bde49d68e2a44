"""The messages between a run and its watchdog, one line each."""

READY = b"ready\n"  # the watchdog watches
BEAT = b"here\n"  # sent by the run with each heartbeat, and returned by the watchdog
DONE = b"done\n"  # the run has left the station safe
