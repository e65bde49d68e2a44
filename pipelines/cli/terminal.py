"""The operator at a terminal: questions on standard error, answers from standard input, a line each, typed or scanned."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from pipelines.cli.options import error_console
from pipelines.jobs.seating import Seating, scan
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    from pipelines.chain.attendance import Answer, Prompt

YES = frozenset({"", "y", "yes", "go", "ok"})
STOP = frozenset({"stop", "s", "q", "quit", "no", "n"})
TITLES = {"load": "Load", "confirm": "Seats", "trouble": "Trouble", "unload": "Unload", "approve": "Approve"}


class Terminal:
    """Whoever sits at the terminal; ``quiet`` keeps progress bars still while somebody is asked."""

    def __init__(self, quiet: Callable[[], AbstractContextManager[None]]) -> None:
        self._quiet = quiet

    def ask(self, prompt: Prompt) -> Answer:
        """Enter goes on, ``stop`` stops."""
        with self._quiet():
            out = error_console()
            out.print(f"\n{TITLES[prompt.kind]}  ", style="bold", end="")
            out.print(f"{prompt.text}.", markup=False, soft_wrap=True)
            for slot, serial in prompt.slots:
                out.print(f"  slot {slot:>2}  {serial}", markup=False)
            return "stop" if _line("Enter when done, 'stop' to leave it: ").lower() in STOP else "go"


def scanned(slots: int) -> Seating:
    """The seating as it is scanned at the terminal, slot by slot."""
    out = error_console()
    out.print(f"Scan the units, slot by slot (0 to {slots - 1}); Enter alone leaves a slot empty.", markup=False)
    found = scan(
        slots, lambda slot: _line(f"slot {slot:>2}: "), lambda words: out.print(words, style="yellow", markup=False)
    )
    if not found.units:
        raise WrongUse("scan: no unit was scanned, one is needed at least; give the command again")
    return found


MEASURES = "y or Enter measures it, n leaves it; Ctrl-C stops, and the same command goes on later"
UNATTENDED = "operator: standard input ended before an answer, a line is needed; run with --no-prompts where nobody is"


def agreed(question: str, choices: str = MEASURES, unattended: str = UNATTENDED) -> bool:
    """The answer at the terminal to a question: Enter alone is yes; an answer that is neither yes nor no is asked again.

    Parameters
    ----------
    choices : what the answers do
    unattended : the error where standard input ends before an answer
    """
    while True:
        answer = _line(f"{question} [Y/n] ", unattended).lower()
        if answer in YES:
            return True
        if answer in STOP:
            return False
        words = f"'{answer}' is neither: {choices}"
        error_console().print(words, style="yellow", markup=False, soft_wrap=True)


def attended() -> bool:
    """Whether somebody sits at the terminal."""
    return sys.stdin.isatty() and sys.stderr.isatty()


def _line(question: str, unattended: str = UNATTENDED) -> str:
    """A line of standard input; its end is nobody to ask."""
    error_console().print(question, end="", markup=False, soft_wrap=True)
    line = sys.stdin.readline()
    if not line:
        raise WrongUse(unattended)
    return line.strip()
