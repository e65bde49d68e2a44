"""The operator at a terminal: questions on standard error, answers from standard input, one line each, typed or scanned."""

import signal
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from threading import Event

from pipelines.chain.attendance import Answer, Prompt
from pipelines.cli.printing import remark
from pipelines.jobs.seating import Seating, scan
from schemas.errors import WrongUse

YES = frozenset({"", "y", "yes", "go", "ok"})
STOP = frozenset({"stop", "s", "q", "quit", "no", "n"})
TITLES = {"load": "Load", "confirm": "Seats", "trouble": "Fault", "unload": "Unload", "approve": "Approve"}


def stopped() -> Event:
    """The event that Ctrl-C, or SIGTERM, sets from now on: the end of a command that serves."""
    stop = Event()
    for name in (signal.SIGTERM, signal.SIGINT):
        signal.signal(name, lambda *_: stop.set())
    return stop


class Terminal:
    """The operator at the terminal; ``quiet`` pauses progress bars during a question."""

    def __init__(self, quiet: Callable[[], AbstractContextManager[None]]) -> None:
        self._quiet = quiet

    def ask(self, prompt: Prompt) -> Answer:
        """Enter continues the run, ``stop`` stops it."""
        with self._quiet():
            remark(f"\n{TITLES[prompt.kind]}  ", style="bold", end="")
            remark(f"{prompt.text}.")
            for slot, serial in prompt.slots:
                remark(f"  slot {slot:>2}  {serial}")
            return "stop" if _line("Enter when done, 'stop' to stop the run: ").lower() in STOP else "go"


def scanned(slots: int) -> Seating:
    """The seating, scanned at the terminal slot by slot."""
    remark(f"Scan the units, slot by slot (0 to {slots - 1}); Enter alone leaves a slot empty.")
    seating = scan(
        slots, lambda slot: _line(f"slot {slot:>2}: ", NOT_SCANNED), lambda message: remark(message, style="yellow")
    )
    if not seating.units:
        raise WrongUse("scan: no unit was scanned, at least one is needed; give the command again")
    return seating


MEASURES = "y or Enter measures it, n leaves it; Ctrl-C stops, and the same command continues"
NOT_SCANNED = (
    "scan: standard input ended before every slot was scanned, a line for each is needed, empty for an empty slot; scan at a "
    "terminal, or name the units with --units SN,… or a slot map"
)
UNATTENDED = "operator: standard input ended before an answer, a line is needed; run without an operator with --yes"


def agreed(question: str, choices: str = MEASURES, unattended: str = UNATTENDED) -> bool:
    """The answer at the terminal to a question: Enter alone is yes; an answer that is neither yes nor no repeats the question.

    choices : what the answers do
    unattended : the error where standard input ends before an answer
    """
    while True:
        answer = _line(f"{question} [Y/n] ", unattended).lower()
        if answer in YES:
            return True
        if answer in STOP:
            return False
        remark(f"'{answer}' is neither yes nor no: {choices}", style="yellow")


def attended() -> bool:
    """Whether standard input and standard error are a terminal."""
    return sys.stdin.isatty() and sys.stderr.isatty()


def _line(question: str, unattended: str = UNATTENDED) -> str:
    """A line of standard input; its end is an error."""
    remark(question, end="")
    line = sys.stdin.readline()
    if not line:
        raise WrongUse(unattended)
    return line.strip()
