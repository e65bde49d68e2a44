"""The watchdog of a run: a process of its own that puts the station into its safe state when the run is gone.

It is told on its standard input what to watch, then that the run lives, and at the end that all is well. The run is gone when
that pipe ends without the word, when the run's process is no longer its parent, or when it has been silent for too long.
Commands come first and notes of them afterwards, and nothing that goes wrong with a note ends it. It goes on, slower, for as
long as the station is not safe. The same commands set the same absolute states, so nothing is harmed when a device gets
one twice.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import time
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schemas.errors import StationError
from schemas.safety import SAFE_WITHIN_S
from schemas.station import StationConfig
from stations.clock import steady
from stations.opening import open_devices
from stations.safety.folder import told
from stations.safety.leases import Leases, Part, addresses, new_holder
from stations.safety.safe_state import SafeStep, reach_safe_state
from stations.safety.watchdog_protocol import BEAT, DONE, READY

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ENDED = "the run's process has ended"
POLL_S = 0.25
TAKE_S = 5.0  # the system may close a dead process' pipe a moment before it frees the locks
SOON_S, SLOWEST_S, SLOWER = 1.0, 30.0, 1.5  # seconds between two tries: at first, at last, and the factor on the way
CHUNK = 4096


def pauses() -> Iterator[float]:
    """Seconds between tries to make a station safe: short for the minute in which it should be, then longer, without end."""
    begun, pause = steady(), SOON_S
    while True:
        yield pause
        if steady() - begun > SAFE_WITHIN_S:
            pause = min(SLOWEST_S, SLOWER * pause)


@dataclass
class Watch:
    """What is watched: the station's way to its safe state, its leases in the run's name, and the process that drives."""

    config: StationConfig
    leases: Leases
    parent: int
    steps: list[SafeStep]
    _heard: float = field(default_factory=steady)

    def until_gone(self) -> str:
        """Why the run counts as gone; empty when it said that all is well."""
        while True:
            word = self._word()
            if word is not None:
                return word
            silent = steady() - self._heard
            if silent > self.config.safety.lapse_s:
                return f"the run has not been heard of for {silent:.0f} s"

    def until_ended(self) -> None:
        """Comes back when a run that stood still has ended: what it might have sent as it woke is undone then."""
        while self._word() is None:
            pass

    def _word(self) -> str | None:
        """Why watching ends, within a moment: empty where all is well; None where it goes on. A run that speaks is answered."""
        ready, _, _ = select.select([0], [], [], POLL_S)
        if not ready:
            return ENDED if os.getppid() != self.parent else None
        words = os.read(0, CHUNK)
        if DONE in words:
            return ""
        if not words:
            return ENDED
        self._heard = steady()
        _tell(BEAT)
        return None

    def make_safe(self, why: str) -> None:
        """Puts the parts that nobody else drives into their safe state, however long it takes, and tells the machine's log."""
        left, done, begun, failed = self._mine(ended=why == ENDED), list[str](), steady(), False
        tell = partial(told, self.leases.folder, self.config.name, run=self.leases.holder.run)
        if not left:
            self.leases.release()  # the next run was quicker: the station is its own
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

    def _mine(self, *, ended: bool) -> list[SafeStep]:
        """The commands that this watchdog may give: for parts whose lease it gets, or of a run that stands still."""
        end = steady() + (TAKE_S if ended else 0.0)
        got: list[Part] = []
        while True:
            got.extend(part for part in self.leases.wanted if part not in got and self._got(part))
            if len(got) == len(self.leases.wanted) or steady() > end:
                break
            time.sleep(POLL_S)
        self.leases.note()
        free = {self.leases.wanted[part] for part in got + self.leases.standing()}
        places: dict[str, str] = {**addresses(self.config, every=True)}
        return [step for step in self.steps if places[step.part] in free]

    def _free_lines(self) -> None:
        """Ends a run that stands still on a serial line: one process at a time can open it, and the station comes first."""
        devices = self.config.devices
        if any(getattr(devices, part).link == "rtu" for part in self.leases.wanted) and os.getppid() == self.parent:
            os.kill(self.parent, signal.SIGKILL)

    def _got(self, part: Part) -> bool:
        """Whether nobody else has a part's lease; where none can be written, nobody can have one."""
        try:
            return self.leases.try_one(part)
        except OSError:
            return True


def _tell(word: bytes) -> None:
    """A word to the run, where it still listens."""
    try:
        os.write(1, word)
    except OSError:  # it is gone, which its pipe tells, or it stands still and has not read the earlier ones
        return


def _sturdy(step: SafeStep) -> SafeStep:
    """A command whose failure never ends this process, whatever it is: it is tried again as any other."""

    def act(command: Callable[[], None]) -> None:
        try:
            command()
        except StationError:
            raise
        except Exception as problem:  # the last that stands between a defect and a hot chamber
            raise StationError(f"{type(problem).__name__}: {problem}") from problem

    return replace(step, act=partial(act, step.act))


def main() -> None:
    """Watches one run to its end."""
    for name in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(name, signal.SIG_IGN)  # it ends when its run does
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
    os.set_blocking(1, False)
    with open_devices(config, ()) as station:  # nothing is connected yet, but all is loaded that will be needed
        watch = Watch(config, leases, os.getppid(), [_sturdy(step) for step in station.safe_steps])
        _tell(READY)
        why = watch.until_gone()
        if why:
            watch.make_safe(why)
        if why not in {"", ENDED}:
            watch.until_ended()
            watch.make_safe(ENDED)


if __name__ == "__main__":
    main()
