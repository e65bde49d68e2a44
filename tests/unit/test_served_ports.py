"""A simulated station that is served on any free port finds one, also when another program takes it in between."""

import socket

import pytest
from served_station import served

from stations import serving


def test_a_port_that_another_program_has_just_taken_is_not_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    search = serving._free_port_pair
    with socket.create_server(("127.0.0.1", 0)) as other:
        taken = int(other.getsockname()[1])
        offers = iter([taken, taken - 1])  # the port of the Modbus server, then that of the line device beside it
        monkeypatch.setattr(serving, "_free_port_pair", lambda host: next(offers, 0) or search(host))
        with served() as port, socket.create_connection(("127.0.0.1", port), 5.0):
            assert port not in {taken, taken - 1}
