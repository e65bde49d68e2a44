"""Coefficients in the memory of devices: they are proved, or the unit is not certified and its valid copy is untouched."""

import os
import re
import shlex
import signal
import struct
import zlib
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from capture_double import small_job, small_run
from driven_station import told
from in_process import refused, text_of
from programmed_lot import LOT, copied_lot, keep_state, plant_of, programmed
from root_process import ROOT
from served_station import modbus_station, served_plant
from typer.testing import CliRunner

from pipelines.archive import Archive, Run
from pipelines.archive.signatures import VARIABLE
from pipelines.certificates import Ledger
from pipelines.certificates.days import today
from pipelines.certificates.entries import WRITING
from pipelines.certificates.programmed import programming, unproved
from pipelines.chain.certify import certify
from pipelines.cli import app
from pipelines.export import UnitCalibration
from pipelines.export.device_block import HEAD, LENGTH, Form, block_of, pack, unpack
from pipelines.integrity import verify
from pipelines.jobs.job import Job
from pipelines.programming import job, process
from pipelines.programming.job import _held, chosen_units, program_run, station_of
from pipelines.programming.outcome import Choice
from schemas.errors import ArchiveUnusable, OperatorNeeded, StationRefused, StationTimeout, WrongUse
from schemas.fault import FaultOrder
from schemas.lot import Lot
from schemas.station import StationConfig
from stations.codec import Value
from stations.devices.memory import UnitMemory
from stations.opening import serve_plant
from stations.profile_files import load_profile
from stations.safety.suspenders import EmergencyStop

COMMAND = next(r for r in load_profile("tumbleline_slot").registers if r.name == "memory_command").address


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.setenv(VARIABLE, "")
    return copied_lot(tmp_path / "copy")


@pytest.fixture
def ledger(run: Run) -> Ledger:
    """The ledger of the run, with a certificate of A1."""
    ledger = Ledger(run.archive.root)
    certify(ledger, run, ["A1"])
    return ledger


def job_of(run: Run) -> Job:
    return small_job(Path(str(run.archive.root)).parent, *LOT)


def copies(run: Run, unit: int = 0) -> list[bytes]:
    plant = plant_of(run, job_of(run))
    return [struct.pack(">192H", *plant.flash[unit].read(copy, plant.now_us)) for copy in (0, 1)]


def test_a_lot_is_written_proved_and_certified_again(run: Run) -> None:
    ledger, day = Ledger(run.archive.root), today()
    first = certify(ledger, run, ["A1", "A2"]).events
    done, given = programmed(run)
    assert {one.outcome for one in done.values()} == {"proved"}, [one.reason for one in done.values()]
    held = ledger.valid_at("A1", day)
    assert held.certificate == given["A1"] == "A1/3"  # certified, ended, certified again
    assert held.until == first[0].until
    assert set(given) == {"A1", "A2"}  # A3 was not certified, and is not by this
    assert ledger.valid_at("A3", day) is None
    block = unpack(copies(run)[0])
    assert (block.unit, block.sequence, block.certificate) == ("A1", 1, 3)
    for one in done.values():
        assert len(one.poses) == 2
        assert all(pose["from_archive_ug"] < 0.5 for pose in one.poses)
        assert all(abs(pose["magnitude_g"] - 9.8123 / 9.80665) < 3e-3 for pose in one.poses)
    events = programming(run.archive.root, "A1")
    assert [entry["event"] for entry in events] == ["begun", "proved"]
    assert events[0]["before"]["copies"]["A"] == "ff" * 384
    assert verify(Archive(run.archive.root), [], keys={}).checked.findings == []


@pytest.mark.slow
def test_the_older_copy_is_written_and_the_other_is_kept(run: Run) -> None:
    assert [unit.unit for _, unit in chosen_units(run, ["A1", "A1"])] == ["A1"]  # named twice, written once
    programmed(run, ("A1",))
    kept = copies(run)[0]
    done, _ = programmed(run, ("A1",), form="q24")
    now = copies(run)
    assert now[0] == kept
    second = unpack(now[1])
    assert (done["A1"].copy, second.sequence, second.form) == ("b", 2, "q24")
    third, _ = programmed(run, ("A1",))
    assert third["A1"].copy == "a"
    assert programming(run.archive.root, "A1")[4]["before"]["copies"]["B"] == now[1].hex()


DIFFERS = "differs from what was written"


@pytest.mark.parametrize(
    ("kind", "figures", "step", "reason"),
    [
        ("memory_bad_block", {"copy": 1, "word": 40}, "read back", f"{DIFFERS} from byte 80"),
        pytest.param("memory_worn", {}, "archive the memory", "worn out", marks=pytest.mark.slow),
        ("memory_power_lost", {"after_s": 0.45}, "read back", DIFFERS),
    ],
)
def test_a_fault_leaves_the_valid_copy_and_no_certificate(
    run: Run, ledger: Ledger, kind: str, figures: dict[str, float], step: str, reason: str
) -> None:
    certify(ledger, run, ["A2"])
    programmed(run)
    kept, plant = copies(run)[0], plant_of(run, job_of(run))
    plant.inject(FaultOrder(kind=kind, serial="A1", figures=figures, at_s=plant.now))
    place = run.archive.root / "programming" / "station" / f"{run.about['capture']}.bin"
    Path(str(place)).write_bytes(plant.journal.state(plant.now_us))
    done, given = programmed(run)
    one = done["A1"]
    assert (one.outcome, one.step) == ("failed", step), one.reason
    assert reason in one.reason
    newest = [block for content in copies(run) if (block := unpack(content)) is not None]
    assert [block.sequence for block in newest] == [1]  # never half written: the copy of the first time counts
    assert copies(run)[0] == kept
    if kind == "memory_worn":  # nothing was written, so the certificate stays
        assert unproved(run.archive.root, "A1") == ""
        return
    assert "A1" not in given
    assert ledger.valid_at("A1", today()) is None
    with pytest.raises(WrongUse, match="unit A1: the writing of its memory failed"):
        certify(ledger, run, ["A1"])
    assert "A1" in certify(ledger, run).left_out
    if kind == "memory_bad_block":
        assert done["A2"].outcome == "proved"  # the others go on


def test_coefficients_that_do_not_fit_the_unit_are_found_in_the_poses(run: Run) -> None:
    done, _ = programmed(run, ("A1",), tolerance_ug=1.0)
    assert (done["A1"].outcome, done["A1"].step) == ("failed", "verify")
    assert "µg from the force" in done["A1"].reason


def test_offset_registers_move_the_output_and_are_written_after_each_power_on(run: Run) -> None:
    done, _ = programmed(run, ("A1",), with_offsets=True)
    one = done["A1"]
    assert one.outcome == "proved", one.reason
    bias_ug = one.unit.bias[0] / 256000.0 * 1e6
    left = bias_ug + np.array(one.block.offsets) * 62.5
    assert np.max(np.abs(left)) <= 31.3  # half a step of 62.5 µg
    plant = plant_of(run, job_of(run))
    assert plant.flash[0].offsets == list(one.block.offsets)
    plant.switch(on=False)
    assert plant.flash[0].offsets == [0, 0, 0]


def calibration() -> UnitCalibration:
    bias, response = np.zeros((4, 3)), np.zeros((4, 3, 3))
    bias[0], bias[1], response[0] = (5120.0, -2560.0, 100.0), (12.8, 0.0, -3.0), 256000.0 * np.eye(3) + 700.0
    return UnitCalibration("SN-1", "pass", "industrial", "LSB", bias, response, (-10.0, 60.0), ())


def test_a_block_is_what_its_layout_says_and_a_memory_that_is_erased_or_damaged_holds_none() -> None:
    """Read by the table of the layout, not by the module that wrote it."""
    block = block_of(calibration(), "float32", sequence=7, certificate=3, date=20261122, offsets=(2, -1, 0), step=16)
    content = pack(block)
    assert len(content) == LENGTH == 308
    assert struct.calcsize(HEAD) == 112
    assert content[:4] == b"TLCB"
    assert struct.unpack_from("<HHH", content, 4) == (1, 1, 308)
    assert struct.unpack_from("<I", content, 12)[0] == 7
    assert content[16:80].rstrip(b"\0") == b"SN-1"
    assert struct.unpack_from("<II", content, 80) == (3, 20261122)
    assert struct.unpack_from("<ff", content, 88) == (-10.0, 60.0)
    assert struct.unpack_from("<hhh", content, 104) == (2, -1, 0)
    assert struct.unpack_from("<3f", content, 112) == (5120.0 + 32.0, -2560.0 - 16.0, 100.0)
    assert struct.unpack_from("<I", content, 304)[0] == zlib.crc32(content[:304])
    assert [unpack(data) for data in (b"\xff" * 384, b"\0" * 384, content[:200])] == [None] * 3
    for place in (5, 20, 90, 150, 305):
        spoilt = bytearray(content)
        spoilt[place] ^= 0x10
        assert unpack(bytes(spoilt)) is None


@pytest.mark.parametrize("form", ["float32", "q24"])
def test_a_block_corrects_as_the_calibration(form: Form) -> None:
    unit = calibration()
    content = pack(block_of(unit, form, sequence=1, certificate=0, date=0, offsets=(0, 0, 0), step=0))
    block, output = unpack(content + b"\xff" * 76), np.array([[250000.0, -3000.0, 120000.0]])
    for t in (-10.0, 25.0, 60.0):
        np.testing.assert_allclose(block.correct(output, t), unit.correct(output, t), atol=5e-7)


def test_a_lost_answer_is_decided_by_the_counter_and_a_memory_that_samples_refuses(run: Run) -> None:
    small = job_of(run)
    plant = plant_of(run, small)
    with serve_plant(small.station, small.lot, plant) as station:
        memory = station.reader.slots[0].memory(station.clock)
        registers = memory._registers
        plain = registers.write

        def answer_lost(name: str, value: Value) -> None:
            plain(name, value)
            if name == "memory_command":
                raise StationTimeout("slot 0: no answer within 1 s; check the cable")

        registers.write = answer_lost
        memory.program("a", b"\x12\x34" * 100)
        registers.write = lambda name, value: (_ for _ in ()).throw(StationTimeout("slot 0: no answer"))
        with pytest.raises(StationTimeout):
            UnitMemory(registers, station.clock).program("a", b"\x12\x34" * 100)
        orders = [e for e in plant.journal.events() if getattr(e, "address", -1) == COMMAND]
        registers.write = plain
        station.reader.start(100.0)
        with pytest.raises((StationRefused, StationTimeout)):  # it samples
            memory.set_offsets((1, 1, 1))
        station.reader.stop()
        memory.set_offsets((1, 1, 1))
        assert memory.offsets() == (1, 1, 1)
    assert len(orders) == 1
    assert plant.flash[0].erases == [1, 0]
    assert plant.flash[0].read(0, plant.now_us)[0] == 0x1234


def writing(root: Path, step: str, config: StationConfig | None) -> None:
    """A writing of A1 that kills its process at a step."""

    def report(text: str) -> None:
        if step in text:
            os.kill(os.getpid(), signal.SIGKILL)

    run = Archive(root).run("latest")
    program_run(run, chosen_units(run, ["A1"]), config or station_of(run), Choice(), report)


def killed(run: Run, ledger: Ledger, step: str, config: StationConfig | None = None) -> None:
    """A writing that was killed leaves the unit without a certificate."""
    words = (Path(str(run.archive.root)), step, config)
    process = get_context("spawn").Process(target=writing, args=words, daemon=True)
    process.start()
    process.join(120.0)
    assert process.exitcode == -signal.SIGKILL
    assert ledger.valid_at("A1", today()) is None
    assert "has no end" in unproved(run.archive.root, "A1")


@pytest.mark.slow
@pytest.mark.parametrize("step", ["A1: write", "A1: read back", "power cycle", "verify in pose"])
def test_a_process_that_is_killed_leaves_the_unit_not_certified_until_it_is_written_again(
    run: Run, ledger: Ledger, step: str
) -> None:
    killed(run, ledger, step)
    with pytest.raises(WrongUse, match="has no end"):
        certify(ledger, run, ["A1"])
    again, given = programmed(run, ("A1",))
    assert again["A1"].outcome == "proved", again["A1"].reason
    assert ledger.valid_at("A1", today()).certificate == given["A1"] == "A1/3"
    assert again["A1"].block.certificate == 3
    assert [entry["event"] for entry in programming(run.archive.root, "A1")] == ["begun", "begun", "proved"]


@pytest.mark.slow
def test_killed_on_hardware_the_watchdog_makes_the_station_safe_and_the_next_writing_proves(
    run: Run, ledger: Ledger, state: Path
) -> None:
    with served_plant(lot=Lot.model_validate(run.about["lot"])) as (port, plant):
        config = modbus_station(port)
        killed(run, ledger, "A1: read back", config)
        told("watchdog_safe")
        [again], _ = program_run(
            run, chosen_units(run, ["A1"]), config, Choice(tolerance_ug=5000.0), lambda _text: None
        )
        assert again.outcome == "proved", again.reason
        with plant.lock:
            held = [unpack(struct.pack(">192H", *plant.flash[0].read(copy, plant.now_us))) for copy in (0, 1)]
            orders = [e for e in plant.journal.events() if getattr(e, "address", -1) == COMMAND]
    assert sorted(block.sequence for block in held if block is not None) in ([1], [1, 2])
    assert len(orders) == 2  # once for each writing
    assert unproved(run.archive.root, "A1") == ""


def test_the_command_asks_before_it_writes_and_what_was_revoked_is_not_written(run: Run, ledger: Ledger) -> None:
    ledger.revoke("A1", "fell to the floor", day=today())
    with pytest.raises(WrongUse, match="fell to the floor"):
        programmed(run, ("A1",))
    assert programming(run.archive.root, "A1") == []
    words = ["station", "program", "latest", "--archive", str(run.archive.root), "--units"]
    assert isinstance(CliRunner().invoke(app, [*words, "A2"], input="").exception, WrongUse)
    assert "nothing was written" in CliRunner().invoke(app, [*words, "A2"], input="n\n").stdout
    assert programming(run.archive.root, "A2") == []
    assert "proved" in text_of(*words, "A2", "--yes")
    assert "no unit B9" in refused(*words, "B9", "--yes")


@pytest.mark.slow
@pytest.mark.usefixtures("ledger")
def test_the_guide_prints_what_the_command_prints(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    guide = (ROOT / "docs" / "how-to" / "program-the-device.md").read_text(encoding="utf-8")
    command, _, printed = re.findall(r"```console\n\$ (.*?)```", guide, flags=re.DOTALL)[0].partition("\n")
    monkeypatch.setenv("TUMBLELINE_ARCHIVE", str(run.archive.root))
    shown, wanted = (re.sub(r"[─\s]+", " ", text).strip() for text in (text_of(*shlex.split(command)[1:]), printed))
    assert re.fullmatch(re.escape(wanted).replace("…", ".*?"), shown), shown
    assert str(LENGTH) in guide


@pytest.mark.parametrize(
    ("kind", "after_s", "events"), [("emergency_stop", 0.0, []), ("door", 0.0, []), ("door", 6.0, ["begun", "failed"])]
)
def test_nothing_is_written_while_the_emergency_stop_is_pressed_or_the_door_open_and_an_opened_door_ends_it(
    run: Run, ledger: Ledger, kind: str, after_s: float, events: list[str]
) -> None:
    keep_state(run, job_of(run), lambda plant: plant.inject(FaultOrder(kind=kind, at_s=plant.now + after_s)))
    with pytest.raises(EmergencyStop if kind == "emergency_stop" else OperatorNeeded):
        programmed(run, ("A1",))
    assert [entry["event"] for entry in programming(run.archive.root, "A1")] == events
    assert (ledger.valid_at("A1", today()) is None) == bool(events)


def test_a_calibration_that_ended_for_another_reason_does_not_come_back(run: Run, ledger: Ledger) -> None:
    ledger.revoke("A1", WRITING, day=today())
    assert _held(ledger, "A1", run.id, today()).event.sequence == 1
    certify(ledger, run, ["A1"], reason="given again")
    ledger.revoke("A1", "dropped", day=today())
    assert _held(ledger, "A1", run.id, today()) is None


def test_an_older_run_is_not_written_over_a_newer_certified_one(run: Run, ledger: Ledger) -> None:
    ledger.revoke("A1", WRITING, day=today())  # a writing of this run began once and was not completed
    other = small_run(Path(str(run.archive.root)).parent, None, *LOT, ('"small"', '"later"'))
    certify(ledger, other, ["A1"])
    words = rf"certificate A1/3 is of run {re.escape(other.id)}.*not after it; write that run"
    with pytest.raises(WrongUse, match=words):
        programmed(run, ("A1",))
    assert ledger.valid_at("A1", today()).run == other.id
    assert programming(run.archive.root, "A1") == []
    programmed(run, ("A2",))  # the other units are not concerned


@pytest.mark.slow
def test_a_certificate_that_comes_in_between_does_not_leave_a_number_that_the_device_does_not_have(
    run: Run, ledger: Ledger, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, real_certify = job.open_lot, job.certify

    def meanwhile(*words: object) -> object:
        ledger.revoke("A1", "by another process", day=today())
        certify(ledger, run, ["A1"], months=3, reason="another process")
        return real(*words)

    with monkeypatch.context() as patch:
        patch.setattr(job, "open_lot", meanwhile)
        done, given = programmed(run, ("A1",))
    assert given == {"A1": f"A1/{done['A1'].block.certificate}"} == {"A1": "A1/5"}

    def late(*words: object, **more: object) -> object:
        real_certify(ledger, run, ["A1"], months=2)  # a process that had looked before the writing began
        return real_certify(*words, **more)

    with monkeypatch.context() as patch:
        patch.setattr(job, "certify", late)
        done, given = programmed(run, ("A1",))
    assert given == {}
    assert (done["A1"].outcome, done["A1"].step) == ("failed", "certify")
    assert ledger.valid_at("A1", today()) is None
    again, given = programmed(run, ("A1",))
    assert again["A1"].outcome == "proved"
    assert given == {"A1": f"A1/{again['A1'].block.certificate}"}


def test_a_failure_that_cannot_be_recorded_hides_neither_its_cause_nor_the_other_units(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def off(_self: object) -> None:
        raise KeyboardInterrupt

    real = process.add

    def full(root: object, serial: str, event: str, content: dict) -> object:
        if serial == "A1" and event == "failed":
            raise ArchiveUnusable("no space left on device")
        return real(root, serial, event, content)

    monkeypatch.setattr(process, "add", full)
    monkeypatch.setattr(process.Programmer, "_power_cycle", off)
    with pytest.raises(KeyboardInterrupt) as caught:
        programmed(run, ("A1", "A2"))
    assert any("unit A1 could not be recorded either: no space" in note for note in caught.value.__notes__)
    assert [entry["event"] for entry in programming(run.archive.root, "A2")] == ["begun", "failed"]
    assert "has no end" in unproved(run.archive.root, "A1")
