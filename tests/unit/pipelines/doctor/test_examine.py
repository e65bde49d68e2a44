"""What doctor finds in a healthy installation, and in one with a single thing broken: the fault and its remedy."""

import base64
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from email.utils import formatdate
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import pytest
from each import each
from in_process import document_of, text_of
from s3_server import CREDENTIALS, s3_bucket
from served_station import modbus_station, moves_ordered, served_plant, station_file
from small_server import answering

from pipelines.archive import Archive
from pipelines.archive.signatures import make_key
from pipelines.doctor import examine as host
from pipelines.doctor import software
from pipelines.doctor.archive import archive_checks, key_checks
from pipelines.doctor.check import PROBE_BYTES, clock_check, offset
from pipelines.doctor.documents import Check
from pipelines.doctor.examine import host_checks, station_checks
from pipelines.doctor.orchestrator import orchestrator_checks
from stations.safety.lease_files import addresses
from stations.safety.leases import Leases, new_holder

NOBODY = 65534
KEY = "line:" + "k" * 32


@pytest.fixture(autouse=True)
def own_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No setting of this machine; a state folder, a configuration and a working folder of the test."""
    for name in [n for n in os.environ if n.startswith(("PREFECT_", "TUMBLELINE_"))] + ["CREDENTIALS_DIRECTORY"]:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TUMBLELINE_STATE", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.chdir(tmp_path)


def archive_in(folder: Path) -> Archive:
    archive = Archive(folder)
    archive.prepare()
    return archive


def states(checks: list[Check]) -> dict[str, str]:
    return {check.check: check.state for check in checks}


def only_fault(checks: list[Check]) -> Check:
    """The one fault among checks; it says what was found and what to do."""
    (fault,) = [check for check in checks if check.state == "fault"]
    assert fault.found
    assert fault.remedy
    return fault


def test_a_healthy_archive_is_good_and_holds_nothing_of_the_check_afterwards(tmp_path: Path) -> None:
    archive_in(tmp_path / "a")
    before = sorted((tmp_path / "a").rglob("*"))
    checks = archive_checks(str(tmp_path / "a"), 0.0)
    assert set(states(checks)) == {"reachable", "format", "writable", "clock", "free space"}
    assert set(states(checks).values()) == {"good"}
    assert sorted((tmp_path / "a").rglob("*")) == before


def entry_of_tomorrow(folder: Path) -> None:
    (folder / "runs").mkdir()
    os.utime(folder / "runs", (time.time() + 3600.0,) * 2)


def other_format(folder: Path) -> None:
    (folder / "archive.json").write_text('{"product": "tumbleline", "format": 99}', encoding="utf-8")


@each([
    (shutil.rmtree, 1.0, "reachable", "mount"),
    (other_format, 0.0, "format", ""),
    (lambda _: None, 1e9, "free space", ""),
    (entry_of_tomorrow, 0.0, "last entry", "clock"),
], lambda row: row[2])  # fmt: skip
def test_what_is_wrong_with_an_archive_is_named(case: tuple, tmp_path: Path) -> None:
    change, free_gb, check, remedy = case
    archive_in(tmp_path / "a")
    assert "fault" not in states(archive_checks(str(tmp_path / "a"), 0.0)).values()
    change(tmp_path / "a")
    fault = only_fault(archive_checks(str(tmp_path / "a"), free_gb))
    assert fault.check == check
    assert remedy in fault.remedy


@pytest.fixture
def of_nobody() -> Iterator[Path]:
    """An archive of a user without rights, who the test is meanwhile: pytest's folders are for their owner only."""
    folder, root = Path(tempfile.mkdtemp(prefix="tumbleline-test-")), os.geteuid() == 0
    folder.chmod(0o755)
    archive_in(folder / "a")
    if root:
        os.chown(folder / "a", NOBODY, NOBODY)
        os.seteuid(NOBODY)
    yield folder / "a"
    if root:
        os.seteuid(0)
    shutil.rmtree(folder)


def test_an_archive_without_permission_to_write_or_to_look_into_it_is_a_fault(of_nobody: Path) -> None:
    for mode, check in ((0o555, "writable"), (0o000, "reachable")):
        of_nobody.chmod(mode)
        fault = only_fault(archive_checks(str(of_nobody), 0.0))
        assert fault.check == check
        assert "Permission denied" in fault.found
        of_nobody.chmod(0o755)
        assert "fault" not in states(archive_checks(str(of_nobody), 0.0)).values()


FULL = """
import json, resource, signal, sys
from dataclasses import astuple
from pipelines.doctor.archive import archive_checks
from pipelines.doctor.examine import host_checks
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
print(json.dumps([[astuple(check) for check in checks] for checks in (archive_checks(sys.argv[1], 0.0), host_checks())]))
"""


@pytest.mark.parametrize(("room", "state"), [(PROBE_BYTES // 2, "fault"), (PROBE_BYTES, "good")])
def test_a_disk_that_takes_half_a_file_is_a_fault_and_nothing_stays(tmp_path: Path, room: int, state: str) -> None:
    archive_in(tmp_path / "a")
    words = [sys.executable, "-c", FULL, str(tmp_path / "a"), str(room)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    of_archive, of_host = json.loads(done.stdout)
    assert {row[1]: row[2] for row in of_archive}["writable"] == state
    assert {(row[0], row[1]): row[2] for row in of_host}["state folder", "writable"] == state
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["archive.json"]
    assert not list((tmp_path / "state").iterdir())


@pytest.mark.slow
def test_an_object_store_is_written_to_timed_and_left_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in CREDENTIALS.items():
        monkeypatch.setenv(name, value)
    with s3_bucket() as query:
        address = f"s3://factory/archive?{query}"
        archive_in(address)
        by_check = states(archive_checks(address, 1.0))
        assert by_check == dict.fromkeys(("reachable", "format", "writable", "clock"), "good")
        assert [p.name for p in Archive(address).root.iterdir()] == ["archive.json"]
    assert only_fault(archive_checks(address, 1.0)).check == "reachable"  # the server is down now


def test_a_key_is_usable_private_and_outside_the_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TUMBLELINE_SIGNING_KEY", str(tmp_path / "k"))
    assert only_fault(key_checks(None)).check == "present"
    (tmp_path / "k").write_bytes(b"no key")
    assert only_fault(key_checks(None)).check == "present"
    monkeypatch.delenv("TUMBLELINE_SIGNING_KEY")
    archive_in(tmp_path / "a")
    assert states(key_checks(str(tmp_path / "a"))) == {"present": "warning"}
    key = tmp_path / "keys" / "signing.key"
    make_key(key)
    monkeypatch.setenv("TUMBLELINE_SIGNING_KEY", str(key))
    assert set(states(key_checks(str(tmp_path / "a"))).values()) == {"good"}
    key.chmod(0o644)
    assert only_fault(key_checks(str(tmp_path / "a"))).remedy == f"run: chmod 600 {key}"
    inside = tmp_path / "a" / "signing.key"
    make_key(inside)
    monkeypatch.setenv("TUMBLELINE_SIGNING_KEY", str(inside))
    assert only_fault(key_checks(str(tmp_path / "a"))).check == "outside the archive"


def of_server(
    monkeypatch: pytest.MonkeyPatch, key: str = KEY, *, ahead_s: float = 0.0, ready: int = 200, version: str = ""
) -> list[Check]:
    """Of a server that answers as Prefect's does: health and readiness to everybody, the version to the key."""

    def answer(request: bytes) -> bytes:
        known, body = base64.b64encode(KEY.encode()) in request, json.dumps(version or metadata.version("prefect"))
        statuses = {"/api/health": 200, "/api/ready": ready, "/api/admin/version": 200 if known else 401}
        date = formatdate(time.time() + ahead_s, usegmt=True)
        status = statuses.get(request.split()[1].decode(), 404)
        return f"HTTP/1.1 {status} -\r\nDate: {date}\r\nContent-Length: {len(body)}\r\n\r\n{body}".encode()

    with answering(answer) as ((host, port), _):
        monkeypatch.setenv("PREFECT_API_URL", f"http://{host}:{port}/api")
        monkeypatch.setenv("PREFECT_API_AUTH_STRING", key)
        return orchestrator_checks()


def test_a_healthy_server_is_good_and_one_of_another_version_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    good = dict.fromkeys(("reachable", "database", "authenticated", "version", "clock"), "good")
    assert states(of_server(monkeypatch)) == good
    assert states(of_server(monkeypatch, version="1.0.0")) == good | {"version": "warning"}


@each([
    ({"key": "line:" + "x" * 32}, "authenticated", r"the key is refused \(401\)", "PREFECT_API_AUTH_STRING"),
    ({"key": ""}, "authenticated", "", ""),
    ({"ready": 503}, "database", "", ""),
    ({"ahead_s": 120.0}, "clock", r"\+(9|1[0-4])\d\.\d s", ""),
    ({"ahead_s": -120.0}, "clock", r"-(9|1[0-4])\d\.\d s", ""),
])  # fmt: skip
def test_what_is_wrong_with_a_server_is_named(
    case: tuple[dict, str, str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    changes, check, found, remedy = case
    fault = only_fault(of_server(monkeypatch, **changes))
    assert fault.check == check
    assert re.match(found, fault.found)
    assert remedy in fault.remedy
    assert "xxxx" not in repr(fault)


def test_an_address_is_a_fault_where_it_is_none_or_nobody_answers_there_and_none_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert states(orchestrator_checks()) == {"address": "not configured"}
    monkeypatch.setenv("PREFECT_API_URL", "127.0.0.1:4200")
    assert only_fault(orchestrator_checks()).check == "address"
    monkeypatch.setenv("PREFECT_API_URL", "http://line:secret@127.0.0.1:9/api")
    fault = only_fault(orchestrator_checks())
    assert fault.check == "reachable"
    assert "secret" not in repr(fault)


def test_a_station_that_answers_is_good_and_nothing_moved(tmp_path: Path) -> None:
    with served_plant() as (port, plant):
        config = modbus_station(port)
        path = station_file(tmp_path, config)
        by_check = states(station_checks(path))
        assert by_check == {"file": "good", "devices": "good", "lease": "good"}
        lease = Leases(tmp_path / "state", new_holder(config.name, "run-7"), addresses(config), 10.0)
        lease.take()
        try:
            checks = station_checks(path)
        finally:
            lease.release()
        assert states(checks)["lease"] == "warning"
        assert any("run-7" in check.found for check in checks)
        assert moves_ordered(plant) == 0


def test_a_station_that_does_not_answer_or_whose_file_is_wrong_is_a_fault_and_none_is_not(tmp_path: Path) -> None:
    checks = station_checks(station_file(tmp_path, modbus_station(9)))
    assert {check.check for check in checks if check.state == "fault"} >= {"table", "chamber", "reader"}
    assert all(check.remedy for check in checks if check.state == "fault")
    (tmp_path / "s.toml").write_text("name = 3\n", encoding="utf-8")
    assert only_fault(station_checks(tmp_path / "s.toml")).check == "file"
    assert states(station_checks(None)) == {"file": "not configured"}


def test_the_clock_is_what_the_kernel_says_and_a_difference_the_least_that_is_sure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert host.clock_state() in {None, 0, 1, 2, 3, 4, 5}
    for state, found in ((0, "good"), (5, "warning"), (None, "not configured")):
        monkeypatch.setattr(host, "clock_state", lambda state=state: state)
        assert states(host_checks())["synchronised"] == found
    assert offset(100.0, 99.0, 101.0, 0.0) == 0.0
    assert offset(98.5, 99.0, 101.0, 1.0) == 0.0
    assert offset(90.0, 99.0, 101.0, 1.0) == -8.0
    assert offset(110.0, 99.0, 101.0, 1.0) == 9.0
    assert clock_check("archive", 4.9, "it").state == "good"
    assert clock_check("archive", -5.1, "it").state == "fault"


def test_this_environment_meets_the_requirements() -> None:
    checks = {check.check: check for check in software.software_checks()}
    assert checks["libraries"].state == "good"
    assert {checks[name].state for name in ("Python", "lock")} <= {"good", "warning"}
    assert "docs" not in checks["optional parts"].found  # builds the pages of the product, which its users read


@pytest.mark.slow
@each([("numpy", "1.0", "numpy", "fault"), ("click", None, "click", "fault"), ("numpy", "99.0", "lock", "warning")])
def test_a_library_that_is_missing_or_of_another_version_is_named(
    case: tuple[str, str | None, str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    name, held, check, state = case
    version, distributions = metadata.version, metadata.distributions

    def changed(asked: str) -> str:
        if asked.lower() != name:
            return version(asked)
        if held is None:
            raise metadata.PackageNotFoundError(asked)
        return held

    monkeypatch.setattr(software.metadata, "version", changed)
    other = [SimpleNamespace(name=name, version=held)] if held else []
    monkeypatch.setattr(software.metadata, "distributions", lambda: [*distributions(), *other])
    rows = {row.check: row for row in software.software_checks()}
    assert rows[check].state == state
    assert "pip install" in rows[check].remedy


def test_the_command_says_the_remedy_and_leaves_with_its_status(tmp_path: Path) -> None:
    printed = text_of("doctor", "--archive", tmp_path / "none", status=1)
    assert "fault: archive, reachable: " in printed
    assert "mount its disk or correct the address" in printed
    archive_in(tmp_path / "a")
    document = document_of("doctor", "--archive", tmp_path / "a", "--free-gb", "0", status=0)
    assert (document["ok"], document["faults"]) == (True, 0)
    assert Path(document["samples"], "recipes", "line-six.toml").is_file()
