"""The writing of devices through real sockets, with lease and watchdog; and a process that is killed in the middle."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from driven_station import told
from programmed_lot import copied_lot
from root_process import ROOT
from served_station import modbus_station, served_plant, station_file

from pipelines.archive.signatures import VARIABLE
from pipelines.certificates import Ledger
from pipelines.certificates.days import today
from pipelines.certificates.programmed import unproved
from pipelines.chain.certify import certify
from pipelines.export.device_block import unpack
from schemas.lot import Lot
from stations.profile_files import load_profile

CLIENT = """
import os, signal, sys
from pathlib import Path
from pipelines.archive import Archive
from pipelines.programming.job import chosen_units, program_run
from pipelines.programming.outcome import Choice
from schemas.station import load_station
run = Archive(sys.argv[1]).run("latest")

def report(text):
    print(text, flush=True)
    if sys.argv[3] in text:
        os.kill(os.getpid(), signal.SIGKILL)

done, given = program_run(run, chosen_units(run, ["A1"]), load_station(Path(sys.argv[2])), Choice(tolerance_ug=5000.0), report)
assert [one.outcome for one in done] == ["proved"], [one.reason for one in done]
"""


@pytest.mark.slow
def test_killed_while_it_writes_the_watchdog_makes_the_station_safe_and_the_next_writing_proves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, state: Path
) -> None:
    monkeypatch.setenv(VARIABLE, "")
    run = copied_lot(tmp_path / "copy")
    ledger = Ledger(run.archive.root)
    certify(ledger, run, ["A1"])
    with served_plant(lot=Lot.model_validate(run.about["lot"])) as (port, plant):
        file = station_file(tmp_path, modbus_station(port))

        def client(step: str) -> subprocess.CompletedProcess[str]:
            words = [sys.executable, "-c", CLIENT, str(run.archive.root), str(file), step]
            return subprocess.run(words, cwd=ROOT, check=False, capture_output=True, text=True, env={**os.environ})

        killed = client("A1: read back")
        assert killed.returncode == -signal.SIGKILL, killed.stderr
        assert ledger.valid_at("A1", today()) is None
        assert "has no end" in unproved(run.archive.root, "A1")
        told("watchdog_safe")
        again = client("never")
        assert again.returncode == 0, again.stderr
        with plant.lock:
            held = [
                unpack(b"".join(w.to_bytes(2, "big") for w in plant.flash[0].read(c, plant.now_us))) for c in (0, 1)
            ]
            command = next(r for r in load_profile("tumbleline_slot").registers if r.name == "memory_command").address
            orders = [e for e in plant.journal.events() if getattr(e, "address", -1) == command]
    assert sorted(block.sequence for block in held if block is not None) in ([1], [1, 2])
    assert len(orders) == 2  # once for each writing
    assert unproved(run.archive.root, "A1") == ""
