"""Keys with certificates that they signed themselves, for tests of signatures, and a second program that checks these."""

import subprocess
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.types import CertificateIssuerPrivateKeyTypes
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import NameOID

from pipelines.certificates.document.signing import SigningKey


def self_signed(
    subject: str, begins: int, ends: int, *, issuer: SigningKey | None = None, authority: bool = False
) -> SigningKey:
    """A key whose certificate holds between these days from now, signed by itself or by an issuer's key."""
    own = ec.generate_private_key(ec.SECP256R1())
    name, now = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, subject)]), datetime.now(UTC)
    builder = x509.CertificateBuilder().subject_name(name).public_key(own.public_key()).serial_number(9)
    builder = builder.issuer_name(name if issuer is None else issuer.certificate.subject)
    builder = builder.not_valid_before(now + timedelta(days=begins)).not_valid_after(now + timedelta(days=ends))
    if authority:
        builder = builder.add_extension(x509.BasicConstraints(True, None), critical=True)
    return SigningKey(own, builder.sign(own if issuer is None else issuer.key, hashes.SHA256()), ())


def made_key(key: CertificateIssuerPrivateKeyTypes) -> SigningKey:
    """A key with a certificate that it signed itself."""
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "Example Sensor Works")])
    now = datetime.now(UTC)
    usage = x509.KeyUsage(True, True, False, False, False, False, False, False, False)
    builder = x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
    builder = (
        builder.serial_number(7).not_valid_before(now - timedelta(days=1)).not_valid_after(now + timedelta(days=30))
    )
    return SigningKey(key, builder.add_extension(usage, critical=True).sign(key, hashes.SHA256()), ())


def pem(signing: SigningKey) -> bytes:
    own = signing.key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    return own + signing.certificate.public_bytes(Encoding.PEM)


def openssl_accepts(document: bytes, trust: Path, folder: Path) -> bool:
    """Whether ``openssl cms`` accepts the last signature of a PDF over the whole file."""
    head = document.rindex(b"/ByteRange")
    a, n, b, m = (int(part) for part in document[head : head + 200].split(b"[", 1)[1].split(b"]", 1)[0].split())
    (folder / "data").write_bytes(document[a : a + n] + document[b : b + m])
    (folder / "cms").write_bytes(bytes.fromhex(document[n + 1 : b - 1].decode()))
    words = ["openssl", "cms", "-verify", "-binary", "-inform", "DER", "-in", "cms", "-content", "data", "-CAfile", str(trust),
             "-purpose", "any", "-out", "out"]  # fmt: skip
    good = subprocess.run(words, cwd=folder, capture_output=True, check=False).returncode == 0
    return good and b + m == len(document)
