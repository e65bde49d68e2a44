"""The watchdog of a run: a process of its own that puts the station into its safe state when the run is gone.

It is told on its standard input what to watch, and at the end that all is well. The run is gone when that pipe ends without
the word, when the run's process is no longer its parent, or when the heartbeat has stopped. The same commands set the
same absolute states, so nothing is harmed when a device gets one twice.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schemas.safety import SAFE_WITHIN_S

if TYPE_CHECKING:
    from schemas.station import StationConfig
    from stations.safety.leases import Leases

READY, DONE = b"ready\n", b"done\n"
ENDED = "the run's process has ended"
POLL_S = 0.25
TAKE_S = 5.0  # the system may close a dead process' pipe a moment before it frees the locks
RESERVE_S = 5.0


@dataclass(frozen=True)
class Watch:
    """What is watched: the station, its leases in the run's name, and the process that drives."""

    config: StationConfig
    leases: Leases
    parent: int

    def until_gone(self) -> str:
        """Why the run counts as gone; empty when it said that all is well, or another drives the station now."""
        beat, heard = 0.0, time.monotonic()
        while True:
            ready, _, _ = select.select([0], [], [], POLL_S)
            if ready:
                word = os.read(0, len(DONE))
                return "" if word == DONE else ENDED
            if os.getppid() != self.parent:
                return ENDED
            now, (last, token) = time.monotonic(), self.leases.last_beat()
            if token not in {"", self.leases.holder.token}:
                return ""
            if last != beat:
                beat, heard = last, now
            if now - heard > self.config.safety.lapse_s:
                return f"the run has not been heard of for {now - heard:.0f} s"

    def make_safe(self, why: str) -> None:
        """Puts the parts that nobody else drives into their safe state; tells the machine's log."""
        from stations.opening import open_devices  # noqa: PLC0415 - it starts this module's process
        from stations.safety.folder import told  # noqa: PLC0415
        from stations.safety.leases import addresses  # noqa: PLC0415
        from stations.safety.safe_state import reach_safe_state  # noqa: PLC0415

        begun, name, folder = time.monotonic(), self.config.name, self.leases.folder
        told(folder, name, "watchdog_acts", run=self.leases.holder.run, why=why)
        free = {self.leases.wanted[part] for part in self._free(ended=why == ENDED)}
        places: dict[str, str] = {**addresses(self.config, every=True)}
        with open_devices(self.config, ()) as station:
            steps = [step for step in station.safe_steps if places[step.part] in free]
            left = SAFE_WITHIN_S - RESERVE_S - self.config.safety.lapse_s - (time.monotonic() - begun)
            reached = reach_safe_state(steps, patience_s=max(RESERVE_S, left))
        event = "watchdog_safe" if reached.safe else "watchdog_failed"
        told(folder, name, event, run=self.leases.holder.run, what=reached.sentence())
        self.leases.release()

    def _free(self, *, ended: bool) -> list[Any]:
        """Parts that this watchdog may command: those whose lease it gets, or all of a run that stands still."""
        end = time.monotonic() + (TAKE_S if ended else 0.0)
        got = [part for part in self.leases.wanted if self.leases.try_one(part)]
        while len(got) < len(self.leases.wanted) and time.monotonic() < end:
            time.sleep(POLL_S)
            got += [part for part in self.leases.wanted if part not in got and self.leases.try_one(part)]
        standing = self.leases.standing()
        if standing:
            self.leases.trip()
        return [part for part in self.leases.wanted if part in got or part in standing]


def ordered() -> Watch:
    """What the run has written as its first line."""
    from schemas.station import StationConfig  # noqa: PLC0415
    from stations.safety.leases import Leases, new_holder  # noqa: PLC0415

    line = b""
    while not line.endswith(b"\n"):
        part = os.read(0, 1)
        if not part:
            sys.exit(0)  # the run ended before it had said what to watch: nothing has moved
        line += part
    order: dict[str, Any] = json.loads(line)
    config = StationConfig.model_validate(order["config"])
    holder = new_holder(config.name, order["run"], "watchdog", order["token"])
    leases = Leases(Path(order["folder"]), holder, order["wanted"], config.safety.lapse_s)
    return Watch(config, leases, os.getppid())


def main() -> None:
    """Watches one run to its end."""
    for name in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(name, signal.SIG_IGN)  # it ends when its run does
    watch = ordered()
    os.write(1, READY)
    os.close(1)
    why = watch.until_gone()
    if why:
        watch.make_safe(why)


if __name__ == "__main__":
    main()
