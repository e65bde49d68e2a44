"""Mutated files of every kind that people bring: refused in one message or read by the rules, soon, and in little memory."""

import json
import os
import selectors
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from long_suites import rounds

HERE = Path(__file__).parent
SEED = 20261122
MANY = rounds(4000, 10_000)
HANG_S = 120.0  # of wall time without a word from the worker, on a machine that others use as well
LONGEST_MESSAGE = 1000


def fuzzed(seed, count):
    """Outcomes (number, reader, what came, words, seconds); a worker that dies or hangs is replaced behind what killed it."""
    outcomes, number = [], 0
    paths = os.pathsep.join(map(str, (HERE.parents[1], HERE.parent)))
    surroundings = {**os.environ, "ARROW_DEFAULT_MEMORY_POOL": "system", "PYTHONPATH": paths}
    while number < count:
        words = map(str, (HERE / "foreign_files.py", seed, number, count - number))
        command = [sys.executable, "-W", "error", *words]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=surroundings) as worker:
            begun, ended = None, True
            for line in lines_of(worker):
                if line is None:
                    ended = False
                    worker.kill()
                    break
                told = json.loads(line)
                if "came" in told:
                    outcomes.append({**begun, **told})
                    begun, number = None, told["number"] + 1
                else:
                    begun = told
            errors = worker.stderr.read().decode()[-2000:]
            status = worker.wait()
        if begun is not None:
            words = f"killed with status {status}: {errors}" if ended else f"nothing for {HANG_S} s"
            outcomes.append({**begun, "came": "broken", "words": words, "seconds": 0.0})
            number = begun["number"] + 1
        elif number < count:
            pytest.fail(f"the worker ended before it began: {errors}")
    return outcomes


def lines_of(worker):
    """Lines of a worker's output as they come; None where none comes for too long."""
    data = b""
    with selectors.DefaultSelector() as selector:
        selector.register(worker.stdout, selectors.EVENT_READ)
        while True:
            if not selector.select(HANG_S):
                yield None
                return
            piece = os.read(worker.stdout.fileno(), 2**16)
            if not piece:
                return
            *whole, data = (data + piece).split(b"\n")
            yield from whole


@pytest.mark.slow  # a few of every format of recordings: tests/contract/test_readers.py; of recipes: test_bad_recipes.py
@pytest.mark.timeout(7200)
def test_no_mutated_file_ends_in_a_traceback_a_hang_or_much_memory() -> None:
    outcomes = fuzzed(SEED, MANY)
    sys.stdout.write(f"seed {SEED}: {dict(Counter(one['came'] for one in outcomes))}\n")
    broken = [one for one in outcomes if one["came"] == "broken"]
    for one in broken:
        sys.stdout.write(f"{one['number']} {one['reader']}: {one['words']}\n")
    assert len(outcomes) == MANY
    assert broken == []
    slow = [(one["number"], one["reader"], one["seconds"]) for one in outcomes if one["seconds"] > 10.0]
    assert slow == []
    words = [one.get("words", "") for one in outcomes]
    assert [text for text in words if len(text) > LONGEST_MESSAGE or "\n" in text] == []
    accepted = {one["reader"].partition(".")[0] for one in outcomes if one["came"] == "accepted"}
    assert accepted >= {"dwells", "raw", "slots", "recording"}
