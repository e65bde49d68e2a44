"""A device has one place, whatever its station's file calls it."""

import os
import socket
from pathlib import Path
from unittest.mock import Mock

import pytest

from schemas.station_devices import Device
from stations.safety.lease_files import address_of


def at(**where: object) -> str:
    return address_of(Device.model_validate({"device_id": 3, "profile": "any", **where}))


def host(name: str) -> str:
    return at(link="tcp", host=name, port=502)


def test_this_machine_is_one_place_under_all_its_names(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("localhost", "LOCALHOST", "127.0.0.1", "127.0.1.1", "::1", socket.gethostname())
    assert {host(name) for name in names} == {"127.0.0.1:502/3"}
    monkeypatch.setattr(socket, "getaddrinfo", Mock(side_effect=socket.gaierror))
    assert host("Chamber") == host("chamber")  # a name that nobody knows


def test_a_host_is_known_by_its_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """The name of a chamber in the line's own name server, and what the two protocols of the internet call it."""
    known = {"chamber": ["192.0.2.7", "2001:db8::7"], "chamber.line.example": ["2001:db8::7", "192.0.2.7"]}

    def found(name: str, *_: object, **__: object) -> list[tuple[object, ...]]:
        return [(0, 0, 0, "", (number, 0)) for number in known.get(name, [name])]

    monkeypatch.setattr(socket, "getaddrinfo", found)
    assert {host(name) for name in (*known, "192.0.2.7")} == {"192.0.2.7:502/3"}
    assert host("192.0.2.8") != host("192.0.2.7")


def test_a_serial_line_is_one_place_under_all_links_to_it(tmp_path: Path) -> None:
    (tmp_path / "by-id").symlink_to("/dev/null")
    (tmp_path / "by-path").symlink_to(tmp_path / "by-id")
    assert {at(link="rtu", serial=str(path)) for path in (tmp_path / "by-id", tmp_path / "by-path", "/dev/null")} == {
        "/dev/null/3"
    }
    assert at(link="rtu", serial="/dev/null") != at(link="rtu", serial="/dev/zero")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root makes device nodes")
def test_a_serial_line_is_one_place_under_all_its_nodes(tmp_path: Path) -> None:
    """As where a container has the line under another name."""
    try:
        os.mknod(tmp_path / "chamber", 0o600 | 0o020000, Path("/dev/null").stat().st_rdev)
    except OSError:
        pytest.skip("no device nodes can be made here")
    assert at(link="rtu", serial=str(tmp_path / "chamber")) == "/dev/null/3"
