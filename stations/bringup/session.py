"""A bring-up from the first reading to the device as it was found."""

import os
import threading
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime

from schemas.errors import StationError
from schemas.profile import Profile
from schemas.safety import Safety
from schemas.station_devices import Device
from stations.bringup.axis_orders import AxisOrders
from stations.bringup.chamber_orders import ChamberOrders
from stations.bringup.keeper import Keeper
from stations.bringup.orders import Orders
from stations.bringup.person import Findings, Person
from stations.bringup.reach import reach
from stations.bringup.survey import Survey, panel, survey
from stations.bringup.target import AsFound, Target, as_found, leave_as_found
from stations.links.gate import Permit
from stations.links.making import SingleLink
from stations.links.recorder import active_recorder
from stations.safety.folder import state_folder
from stations.safety.lease_files import Part, address_of
from stations.safety.leases import Leases, new_holder

BEAT_S = 1.0
TIMEOUT_S = 2.0
SILENCE_S = 40.0
WATCH_S = 20.0
LEASED: dict[str, Part] = {"axis": "outer", "chamber": "chamber"}


@dataclass
class BringUp:
    """A bring-up of one device.

    orders : whether orders are offered at all; readings only otherwise
    timeout_s : longest answer · silence_s : how long the link is cut · watch_s : how long the air of a chamber is watched
    ended : why it ended before its last step; empty at its end
    left : what was done to leave the device as it was found
    """

    profile: Profile
    device: Device
    person: Person
    given_id: int = 0
    search_line: bool = False
    orders: bool = True
    timeout_s: float = TIMEOUT_S
    silence_s: float = SILENCE_S
    watch_s: float = WATCH_S
    findings: Findings = field(default_factory=Findings)
    read: Survey = field(default_factory=Survey)
    made: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))
    ended: str = ""
    left: list[str] = field(default_factory=list[str])
    target: Target = field(init=False)

    def __post_init__(self) -> None:
        self.target = Target(SingleLink(self.device, self.profile, self.timeout_s), self.profile)

    def run(self) -> None:
        """Take all steps; however they end, the device is then put back as it was found, or its keeper goes on trying.

        Raises StationError: nothing answers, another run drives the device, or it cannot be left as it was found now.
        """
        try:
            reach(self.target, self.findings, self.person, given_id=self.given_id, search_line=self.search_line)
            self.read = survey(self.target, self.findings, self.person)
            panel(self.target, self.findings, self.person)
            if self.orders and self.profile.kind in {"axis", "chamber"}:
                self._ordered()
            else:
                unknown = f"no orders are known for a {self.profile.kind}"
                reason = unknown if self.orders else "only readings were asked for"
                self.findings.add("order", "orders", "not tried", reason)
        except BaseException as problem:
            self.ended = "interrupted" if isinstance(problem, KeyboardInterrupt) else str(problem)
            raise
        finally:
            self.target.link.close()

    def _ordered(self) -> None:
        with self._leased() as permit:
            self.target.link.permit = permit
            keeper, found = Keeper(self.target), as_found(self.target)
            keeper.start()
            orders = Orders(self.target, self.findings, self.person, keeper, found, note=self._note)
            try:
                if self.profile.kind == "axis":
                    AxisOrders(orders, self.silence_s).run()
                else:
                    ChamberOrders(orders, self.watch_s, self.silence_s).run()
            finally:
                self._leave(keeper, found)

    def _leave(self, keeper: Keeper, found: AsFound) -> None:
        """Leaves the device as it was found; where that fails now, the keeper goes on trying."""
        try:
            self.left = leave_as_found(self.target, found)
        except StationError as problem:
            keeper.leave_to_it()
            self.person.tell(
                f"the device could not be left as it was found ({problem}); a process goes on trying for an hour"
            )
            raise
        except BaseException:  # another Ctrl-C
            keeper.leave_to_it()
            raise
        self._note(f"left as found: {', '.join(self.left) or 'nothing had changed'}")
        keeper.dismiss()

    def _note(self, text: str) -> None:
        recorder = active_recorder()
        if recorder is not None:
            recorder.note(text)

    @contextmanager
    def _leased(self) -> Generator[Permit]:
        """The lease of the device's address, with its heartbeat: no run may drive it meanwhile."""
        places: dict[Part, str] = {LEASED.get(self.profile.kind, "reader"): address_of(self.target.link.device)}
        holder = new_holder(f"bring-up of {self.profile.name}", f"bring-up {os.getpid()}")
        leases = Leases(state_folder(), holder, places, Safety().lapse_s)
        leases.take()
        stop = threading.Event()
        beat = threading.Thread(target=_beat, args=(leases, stop), name="heartbeat", daemon=True)
        beat.start()
        try:
            yield Permit(leases.alive, leases.require, self.timeout_s * 2.0)
        finally:
            stop.set()
            beat.join()
            leases.release()


def _beat(leases: Leases, stop: threading.Event) -> None:
    while not stop.wait(BEAT_S):
        leases.beat()
