"""Keys with certificates that they signed themselves, for tests of signatures."""

from datetime import UTC, datetime, timedelta

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric.types import CertificateIssuerPrivateKeyTypes
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import NameOID

from pipelines.certificates.document.signing import SigningKey


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
