"""What every order of a bring-up has: a consent that is typed, a keeper, and an end that concerns only its own step."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from schemas.errors import LinkLost, StationError, StationTimeout
from stations.bringup.keeper import Keeper
from stations.bringup.person import Findings, Person, Verdict, judged
from stations.bringup.target import AsFound, Target

Made = TypeVar("Made")
RECONNECT_S = 20.0
PAUSE_S = 0.5


@dataclass
class Orders:
    """The orders of one bring-up; ``blocked`` says why no further order is given."""

    target: Target
    findings: Findings
    person: Person
    keeper: Keeper
    found: AsFound
    blocked: str = ""
    note: Callable[[str], None] = field(default=lambda _: None)

    def step(self, name: str, act: Callable[[], None]) -> None:
        """Take one step; an error of the station ends it and is a finding."""
        self.note(f"step: {name}")
        try:
            act()
        except StationError as problem:
            self.add(name, "differs", str(problem).split("; ")[0], "carried out", "see the recording at this place")
            self.note(f"step ended: {problem}")

    def add(self, what: str, verdict: Verdict, found: str = "", expected: str = "", remedy: str = "") -> None:
        """A finding of an order."""
        self.findings.add("order", what, verdict, found, expected, remedy)
        self.person.tell(f"{verdict}: {what}" + (f": {found}" if found else ""))

    def judge(self, what: str, found: str, expected: str, remedy: str = "", *, good: bool) -> None:
        """A finding of an order that held or differs."""
        self.add(what, judged(good=good), found, expected, remedy)

    def consent(self, word: str, text: str, what: str) -> bool:
        """Whether a person has typed the word for this step; a step without it is not tried."""
        if self.blocked:
            self.findings.add("order", what, "not tried", self.blocked)
            return False
        typed = self.person.ask(f"{text}.\nType {word} to allow it, anything else to skip:").strip()
        self.note(f"consent to {word}: {'typed' if typed == word else 'not given'}")
        if typed != word:
            self.findings.add("order", what, "not tried", "no consent")
        return typed == word

    def moving(self) -> None:
        """From here on the device may have to be stopped, also by the keeper."""
        self.found.moved = True
        self.keeper.keep(self.found)

    def again(self, make: Callable[[], Made]) -> Made:
        """A new connection to a device that may still be away, such as a restarting device."""
        end = time.monotonic() + RECONNECT_S
        while True:
            try:
                return make()
            except (LinkLost, StationTimeout):
                if time.monotonic() > end:
                    raise
                time.sleep(PAUSE_S)
