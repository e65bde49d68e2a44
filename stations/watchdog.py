"""The watchdog of a run: a separate process that puts the station into its safe state when the run is gone.

Its standard input gives it the station, then a message with each heartbeat, and a last message when the station is safe. The run
is gone when that pipe ends without the last message, when the run's process is no longer its parent, or after ``lapse_s`` without
a message. It sends commands first and logs them afterwards; a failed log entry never ends it. It repeats failed commands, at
growing intervals, until the station is safe. A command sets an absolute state, so a device may receive it twice. It is started
by name (:mod:`stations.safety.watchdog_client`), because it stands above the safety modules: it opens devices.
"""

import json
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from schemas.errors import StationError
from schemas.safety import SAFE_WITHIN_S
from schemas.station import StationConfig
from stations.clock import steady
from stations.opening import open_devices
from stations.safety.folder import log_event
from stations.safety.lease_files import Part, addresses
from stations.safety.leases import Leases, new_holder
from stations.safety.safe_state import SafeStep, reach_safe_state
from stations.safety.watchdog_client import BEAT, DONE, READY

ENDED = "the run's process has ended"
POLL_S = 0.25
TAKE_S = 5.0  # the system may close the pipe of a dead process before it releases its locks
SOON_S, SLOWEST_S, SLOWER = 1.0, 30.0, 1.5  # seconds between attempts: first, longest, and growth factor
CHUNK = 4096


def pauses() -> Iterator[float]:
    """Seconds between attempts to make a station safe: short during the first minute, then growing, without end."""
    begun, pause = steady(), SOON_S
    while True:
        yield pause
        if steady() - begun > SAFE_WITHIN_S:
            pause = min(SLOWEST_S, SLOWER * pause)


@dataclass
class Watch:
    """The watch over one run: the commands of the safe state, the leases in the run's name, and the run's process."""

    config: StationConfig
    leases: Leases
    parent: int
    steps: list[SafeStep]
    _heard: float = field(default_factory=steady)

    def until_gone(self) -> str:
        """Waits until the run is gone and returns the reason; empty if it has reported the station safe."""
        while True:
            reason = self._message()
            if reason is not None:
                return reason
            silent = steady() - self._heard
            if silent > self.config.safety.lapse_s:
                return f"no heartbeat of the run for {silent:.0f} s"

    def until_ended(self) -> None:
        """Waits for the end of a run that did not respond; commands that it may have sent meanwhile are undone afterwards."""
        while self._message() is None:
            pass

    def _message(self) -> str | None:
        """The reason why watching ends, empty if the station is safe; None if it continues. Answers the run's heartbeat."""
        ready, _, _ = select.select([0], [], [], POLL_S)
        if not ready:
            return ENDED if os.getppid() != self.parent else None
        data = os.read(0, CHUNK)
        if DONE in data:
            return ""
        if not data:
            return ENDED
        self._heard = steady()
        _send(BEAT)
        return None

    def make_safe(self, why: str) -> None:
        """Puts the parts that no other run drives into their safe state, without a time limit, and logs it."""
        left, done, begun, failed = self._allowed_steps(ended=why == ENDED), list[str](), steady(), False
        tell = partial(log_event, self.leases.folder, self.config.name, run=self.leases.holder.run)
        if not left:
            self.leases.release()  # the next run has taken the leases already
            return
        for number, pause in enumerate(pauses()):
            reached = reach_safe_state(left)
            done += reached.done
            left = [step for step in left if step.what in reached.failed]
            if number == 0:
                tell("watchdog_acts", why=why, pid=os.getpid())
            if not left:
                break
            self.leases.note(trouble=replace(reached, done=[]).sentence())
            if why != ENDED:
                self._free_lines()
            if not failed and steady() - begun + self.config.safety.lapse_s > SAFE_WITHIN_S:
                failed = tell("watchdog_failed", what=replace(reached, done=done).sentence())
            time.sleep(pause)
        tell("watchdog_safe", what="; ".join(done), seconds=round(steady() - begun, 1))
        self.leases.release() if why == ENDED else self.leases.trip()

    def _allowed_steps(self, *, ended: bool) -> list[SafeStep]:
        """The commands that this watchdog may send: for parts whose lease it gets, or whose run does not respond."""
        end = steady() + (TAKE_S if ended else 0.0)
        got: list[Part] = []
        while True:
            got.extend(part for part in self.leases.places if part not in got and self._take(part))
            if len(got) == len(self.leases.places) or steady() > end:
                break
            time.sleep(POLL_S)
        self.leases.note()
        free = {self.leases.places[part] for part in got + self.leases.stalled()}
        places: dict[str, str] = {**addresses(self.config, every=True)}
        return [step for step in self.steps if places[step.part] in free]

    def _free_lines(self) -> None:
        """Ends a run that does not respond on a serial line: only one process can open the line, and safety has priority."""
        devices = self.config.devices
        if (
            any(getattr(devices, part, self.config.devices.reader).link == "rtu" for part in self.leases.places)
            and os.getppid() == self.parent
        ):
            os.kill(self.parent, signal.SIGKILL)

    def _take(self, part: Part) -> bool:
        """Whether no other holder has a part's lease; where no lease can be written, none can exist."""
        try:
            return self.leases.try_one(part)
        except OSError:
            return True


def _send(message: bytes) -> None:
    """Sends a message to the run, where it still reads."""
    try:
        os.write(1, message)
    except OSError:  # the run is gone, or does not respond and its pipe is full
        return


def _sturdy(step: SafeStep) -> SafeStep:
    """A command that turns every exception into a :class:`StationError`, so that it is tried again."""

    def act(command: Callable[[], None]) -> None:
        try:
            command()
        except StationError:
            raise
        except Exception as problem:  # the last protection between a defect and a hot chamber
            raise StationError(f"{type(problem).__name__}: {problem}") from problem

    return replace(step, act=partial(act, step.act))


def main() -> None:
    """Watches one run until its end."""
    for name in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(name, signal.SIG_IGN)  # it ends with its run
    line = b""
    while not line.endswith(b"\n"):
        part = os.read(0, 1)
        if not part:
            sys.exit(0)  # the run ended before it had sent the station: nothing has moved
        line += part
    order: dict[str, Any] = json.loads(line)
    config = StationConfig.model_validate(order["config"])
    holder = new_holder(config.name, order["run"], "watchdog", order["token"])
    leases = Leases(Path(order["folder"]), holder, order["wanted"], config.safety.lapse_s)
    os.set_blocking(1, False)
    with open_devices(config, (), roles=tuple(config.fitted())) as station:  # connects later; all modules are loaded
        watch = Watch(config, leases, os.getppid(), [_sturdy(step) for step in station.safe_steps])
        _send(READY)
        why = watch.until_gone()
        if why:
            watch.make_safe(why)
        if why not in {"", ENDED}:
            watch.until_ended()
            watch.make_safe(ENDED)


if __name__ == "__main__":
    main()
