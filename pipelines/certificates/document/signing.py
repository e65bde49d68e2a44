"""Signatures with the laboratory's key that others can check: PAdES in the PDF, a detached XML signature beside the XML."""

from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any

from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
    pkcs12,
)
from cryptography.x509 import Certificate, load_pem_x509_certificates

from pipelines.certificates.document.dcc import WHERE
from pipelines.certificates.document.signers import not_valid
from schemas.errors import WrongUse
from schemas.library import library

EXTRA = "signatures"
FIELD = "Signature"


@dataclass(frozen=True)
class SigningKey:
    """A private key (P-256 or RSA) with its certificate and the chain above it."""

    key: Any
    certificate: Certificate
    chain: tuple[Certificate, ...]


def read_key(path: Path, password_file: Path | None = None) -> SigningKey:
    """The key of a PKCS#12 file, or of a PEM file with the private key and its certificates, that of the key first.

    Raises
    ------
    WrongUse
        It cannot be read, the password is missing or wrong, there is no certificate beside the key, or it is not valid today.
    """
    try:
        data = path.read_bytes()
        password = None if password_file is None else password_file.read_bytes().splitlines()[0].strip()
    except (OSError, IndexError) as problem:
        raise WrongUse(
            f"--sign-with: {path} or its password cannot be read ({problem}); give a readable PKCS#12 or PEM file"
        ) from None
    try:
        if b"-----BEGIN" in data:
            key, (certificate, *chain) = load_pem_private_key(data, password), load_pem_x509_certificates(data)
        else:
            key, certificate, chain = pkcs12.load_key_and_certificates(data, password)
    except (ValueError, TypeError) as problem:
        raise WrongUse(
            f"--sign-with: {path} is no key that can be used ({problem}); give a PKCS#12 file, or a PEM file with the key and "
            "its certificate, and the file of its password as --sign-with KEY,FILE where it is encrypted"
        ) from None
    if key is None or certificate is None:
        raise WrongUse(f"--sign-with: {path} holds no key with a certificate, both are needed; give a file with both")
    if key.public_key() != certificate.public_key():
        raise WrongUse(
            f"--sign-with: {path}: the first certificate is not that of the key; put the key's own certificate first"
        )
    for member in (certificate, *chain):
        if outside := not_valid(member, datetime.now(UTC)):
            raise WrongUse(
                f"--sign-with: {path}: {outside} ({member.subject.rfc4514_string()}); nothing was signed: renew it, and give "
                "the new file"
            )
    return SigningKey(key, certificate, tuple(chain))


def sign_pdf(document: bytes, key: SigningKey) -> bytes:
    """The PDF with a PAdES signature (baseline B, no time stamp) of the whole file."""
    library("pyhanko", EXTRA, WHERE)
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
    from pyhanko.sign import PdfSignatureMetadata, PdfSigner, SimpleSigner
    from pyhanko.sign.fields import SigSeedSubFilter

    pair = pkcs12.serialize_key_and_certificates(None, key.key, key.certificate, list(key.chain), NoEncryption())
    signer = SimpleSigner.load_pkcs12_data(pair, other_certs=[], passphrase=None)
    meta = PdfSignatureMetadata(
        field_name=FIELD, subfilter=SigSeedSubFilter.PADES, md_algorithm="sha256", reason="Calibration certificate"
    )
    out = BytesIO()
    PdfSigner(meta, signer=signer).sign_pdf(IncrementalPdfFileWriter(BytesIO(document)), output=out)
    return out.getvalue()


def sign_xml(document: bytes, key: SigningKey) -> bytes:
    """A detached XML signature of a document: DCC 3.0.0 has no place for one inside.

    The signature envelopes a copy of the document, so that it can be checked from its file alone; the file beside it stays valid
    against the schema.
    """
    signxml = library("signxml", EXTRA, WHERE)
    etree = library("lxml.etree", EXTRA, WHERE)
    chain = [certificate.public_bytes(Encoding.PEM).decode() for certificate in (key.certificate, *key.chain)]
    private = key.key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    algorithm = "ecdsa-sha256" if isinstance(key.key, ec.EllipticCurvePrivateKey) else "rsa-sha256"
    signer = signxml.XMLSigner(
        method=signxml.methods.enveloping, signature_algorithm=algorithm, digest_algorithm="sha256"
    )
    signed = signer.sign(etree.fromstring(document), key=private, cert=chain)
    return etree.tostring(signed, xml_declaration=True, encoding="UTF-8")
