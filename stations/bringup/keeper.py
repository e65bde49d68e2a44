"""The keeper of a bring-up: a separate process that leaves the device as it was found when the bring-up is gone.

Its standard input gives it the device, then what was found, then that an axis may move, then that all is done. When that pipe
ends without the last message, as after a kill, it stops the axis, writes back what had changed, and tries again until it could.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from typing import IO, Any

from schemas.errors import StationError, StationTimeout
from schemas.profile import Profile
from schemas.station_devices import Device
from stations.bringup.target import AsFound, Target, leave_as_found
from stations.links.making import SingleLink
from stations.safety.watchdog_client import close_pipes, start_module

MODULE = "stations.bringup.keeper"
READY = b"ready\n"
START_S, LEAVE_S = 30.0, 10.0
PAUSES_S = (0.2, 0.5, 1.0)
SLOWEST_S, LONGEST_S = 5.0, 3600.0


@dataclass
class Keeper:
    """The bring-up's side: started before the first order."""

    target: Target
    _process: subprocess.Popen[bytes] | None = field(default=None)

    def start(self) -> None:
        """Starts the process and waits until it keeps.

        Raises StationTimeout: it does not start; nothing has been ordered.
        """
        self._process = start_module(MODULE)
        device = self.target.link.device.model_dump(mode="json")
        profile = self.target.profile.model_dump(mode="json", exclude_defaults=True)
        self._send({"device": device, "profile": profile, "timeout_s": self.target.link.timeout_s})
        if self._process.stdout is None or self._process.stdout.readline() != READY:
            raise StationTimeout(
                "bring-up: its keeper does not start, one is needed before anything is ordered; free memory"
            )

    def keep(self, found: AsFound) -> None:
        """Tells what the device is to be left like."""
        self._send({"found": asdict(found)})

    def dismiss(self) -> None:
        """Ends it: the device is as it was found."""
        if self._process is None:
            return
        self._send({"done": True})
        close_pipes(self._process)
        try:
            self._process.wait(LEAVE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process = None

    def leave_to_it(self) -> None:
        """Closes the pipe, so that it acts: the bring-up could not leave the device as it was found."""
        if self._process is not None and self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()
            _left.append(self._process)

    def _send(self, message: dict[str, Any]) -> None:
        if self._process is None or self._process.stdin is None:
            return
        try:
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()
        except OSError:
            if "done" not in message:
                raise StationTimeout(
                    "bring-up: its keeper has ended, one is needed before anything is ordered"
                ) from None


_left: list[subprocess.Popen[bytes]] = []  # they end by themselves; the reference avoids a ResourceWarning


def _pauses() -> Iterator[float]:
    yield from PAUSES_S
    end = time.monotonic() + LONGEST_S
    while time.monotonic() < end:
        yield SLOWEST_S


def _keep(source: IO[bytes]) -> None:
    """Waits for the end of the bring-up, and acts where it was not the orderly one."""
    order: dict[str, Any] = json.loads(source.readline() or b"{}")
    if not order:
        return  # the bring-up ended before it had named the device: nothing was ordered
    profile = Profile.model_validate(order["profile"])
    device = Device.model_validate(order["device"])
    target = Target(SingleLink(device, profile, float(order["timeout_s"]), recorder=None), profile)
    sys.stdout.buffer.write(READY)
    sys.stdout.buffer.flush()
    found: AsFound | None = None
    for line in source:
        message: dict[str, Any] = json.loads(line)
        if message.get("done"):
            return
        found = AsFound(**message["found"])
    if found is None:
        return
    for pause in _pauses():
        try:
            leave_as_found(target, found)
        except StationError:
            time.sleep(pause)
        else:
            break
    target.link.close()


def main() -> None:
    """Keeps one device."""
    for name in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(name, signal.SIG_IGN)  # it ends with its bring-up
    _keep(sys.stdin.buffer)


if __name__ == "__main__":
    main()
