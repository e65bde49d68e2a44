"""The simulated station on other wires: a serial line between two pseudo-terminals, TLS with certificates made here."""

import datetime as dt
import ipaddress
import os
import select
import ssl
import threading
import tty
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from pymodbus.server import ModbusSerialServer, ModbusTlsServer

from stations.links.modbus import WireLink
from stations.links.wires import TcpWire
from stations.plant.server import PlantServer


def tcp_link(host: str, port: int, *, timeout_s: float, read_attempts: int) -> WireLink:
    """Registers and bits of the devices at one Modbus TCP address, without a gate."""
    return WireLink(TcpWire(host, port, timeout_s), read_attempts=read_attempts)


@dataclass
class Line:
    """A serial line: two terminals' names, and what happens to bytes on their way to each end."""

    host: str
    device: str
    to_host: list = field(default_factory=list)  # functions that each spoil one piece, spent in order
    heard: list = field(default_factory=list)  # what the host has sent
    host_end: int = -1
    held: bytes = b""  # what is on its way to the host and has not arrived

    def hold(self, data):
        """Keeps a piece on its way."""
        self.held += data
        return b""

    def behind_what_is_held(self, data):
        """The pieces that were kept on their way, and this one behind them."""
        before, self.held = self.held, b""
        return before + data

    def deliver(self):
        """Lets what is kept on its way arrive."""
        os.write(self.host_end, self.behind_what_is_held(b""))


@contextmanager
def serial_line():
    """Two pseudo-terminals whose ends are tied together by a thread."""
    (host_end, host), (device_end, device) = os.openpty(), os.openpty()
    for end in (host_end, host, device_end, device):
        tty.setraw(end)
    line, stop = Line(os.ttyname(host), os.ttyname(device), host_end=host_end), threading.Event()

    def carry():
        while not stop.is_set():
            ready, _, _ = select.select([host_end, device_end], [], [], 0.02)
            for end in ready:
                with suppress(OSError):
                    data = os.read(end, 4096)
                    if end == host_end:
                        line.heard.append(data)
                        os.write(device_end, data)
                    else:
                        os.write(host_end, line.to_host.pop(0)(data) if line.to_host else data)

    thread = threading.Thread(target=carry, daemon=True)
    thread.start()
    try:
        yield line
    finally:
        stop.set()
        thread.join(5.0)
        for end in (host_end, host, device_end, device):
            os.close(end)


class SerialPlantServer(PlantServer):
    """Serves a plant as devices on a serial line."""

    def __init__(self, plant, device):
        super().__init__(plant, host=device)

    def make(self, devices):
        return ModbusSerialServer(devices, port=self.host, baudrate=115200, ignore_missing_devices=True)

    def listening_at(self, server):
        return 0


class TlsPlantServer(PlantServer):
    """Serves a plant over TLS; with an authority for clients it asks each for its certificate."""

    def __init__(self, plant, certificate, key, clients=None):
        super().__init__(plant)
        self.context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self.context.load_cert_chain(certificate, key)
        if clients is not None:
            self.context.verify_mode = ssl.CERT_REQUIRED
            self.context.load_verify_locations(clients)

    def make(self, devices):
        address = (self.host, self.port)
        return ModbusTlsServer(devices, address=address, sslctx=self.context, ignore_missing_devices=True)


class Authority:
    """A certificate authority of its own, whose files lie in a folder."""

    def __init__(self, folder: Path, name: str = "authority"):
        self.folder, self.key = folder, ec.generate_private_key(ec.SECP256R1())
        self.name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
        constraint = x509.BasicConstraints(ca=True, path_length=None)
        self.certificate = self._builder(self.name, self.key).add_extension(constraint, critical=True)
        self.certificate = self.certificate.sign(self.key, hashes.SHA256())
        self.file = folder / f"{name}.pem"
        self.file.write_bytes(self.certificate.public_bytes(serialization.Encoding.PEM))

    def _builder(self, subject, key):
        now = dt.datetime.now(dt.UTC)
        return (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(self.name)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - dt.timedelta(hours=1))
            .not_valid_after(now + dt.timedelta(hours=1))
        )

    def issue(self, name: str, host: str = "127.0.0.1") -> tuple[Path, Path]:
        """Files of a certificate and its key."""
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
        names = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address(host))])
        certificate = self._builder(subject, key).add_extension(names, critical=False).sign(self.key, hashes.SHA256())
        files = self.folder / f"{name}.pem", self.folder / f"{name}.key"
        files[0].write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        pem, plain = serialization.Encoding.PEM, serialization.NoEncryption()
        files[1].write_bytes(key.private_bytes(pem, serialization.PrivateFormat.PKCS8, plain))
        return files
