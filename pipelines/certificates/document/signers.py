"""The signers of a certificate, and whether a certificate trusted by the reader vouches for them."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509 import Certificate, load_pem_x509_certificates

from schemas.errors import WrongUse
from schemas.library import library

EXTRA, WHERE = "signatures", "verify"


@dataclass(frozen=True)
class Signer:
    """A valid signature, and its signer.

    certificate : the signer's own; chain : the other certificates beside the signature
    when : the time that the signer stated, UTC; None where the signature has none
    """

    certificate: Certificate
    chain: tuple[Certificate, ...]
    when: datetime | None

    @property
    def name(self) -> str:
        """Subject of the signer's certificate, with the beginning of its fingerprint."""
        from cryptography.hazmat.primitives.hashes import SHA256

        return f"{self.certificate.subject.rfc4514_string()} (SHA-256 {self.certificate.fingerprint(SHA256()).hex()[:16]}…)"


def read_trusted(paths: Sequence[Path]) -> tuple[Certificate, ...]:
    """The certificates of PEM files: of laboratories, or of the authorities that issue their certificates.

    Raises
    ------
    WrongUse
        A file cannot be read or holds no certificate.
    """
    trusted: list[Certificate] = []
    for path in paths:
        try:
            trusted += load_pem_x509_certificates(path.read_bytes())
        except (OSError, ValueError) as problem:
            raise WrongUse(
                f"--trust: {path} holds no certificate that can be read ({problem}); give a PEM file with the certificate of "
                "the laboratory or of its authority"
            ) from None
    return tuple(trusted)


def not_trusted(signer: Signer, trusted: Sequence[Certificate]) -> str:
    """The reason why none of the trusted certificates vouches for a signer today; empty if one does.

    A certificate that is among the trusted ones vouches for itself, any other must lead to one of them. It has to be valid on the
    day of the check: whoever has the key of an expired one can state any time of signing.
    """
    now, certificate = datetime.now(UTC), signer.certificate
    if outside := not_valid(certificate, now):
        return f"{outside}, and nothing proves that it was signed before: {time_of(signer)}"
    return "" if any(certificate == anchor for anchor in trusted) else _path_problem(signer, trusted, now)


def not_valid(certificate: Certificate, now: datetime) -> str:
    """The reason why a certificate is not valid at a time; empty if it is."""
    first, last = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    if first <= now <= last:
        return ""
    return f"the certificate is valid from {first:%Y-%m-%d} to {last:%Y-%m-%d}, not on {now:%Y-%m-%d}"


def time_of(signer: Signer) -> str:
    """A sentence on the time of signing; time stamps of third parties are neither written nor read."""
    if signer.when is None:
        return "the signature states no time and has no time stamp"
    return f"the time of signing, {signer.when:%Y-%m-%d %H:%M} UTC, is the signer's own statement, without a time stamp"


def _path_problem(signer: Signer, trusted: Sequence[Certificate], moment: datetime) -> str:
    """The reason why no path of certificates leads from a signer to a trusted one at a time; empty if one does."""
    certvalidator = library("pyhanko_certvalidator", EXTRA, WHERE)
    asn1 = library("asn1crypto.x509", EXTRA, WHERE)

    def loaded(certificate: Certificate) -> object:
        return asn1.Certificate.load(certificate.public_bytes(Encoding.DER))

    roots = [loaded(anchor) for anchor in trusted]
    context = certvalidator.ValidationContext(
        trust_roots=roots, moment=moment, best_signature_time=moment, allow_fetching=False
    )
    validator = certvalidator.CertificateValidator(
        loaded(signer.certificate), [loaded(certificate) for certificate in signer.chain], validation_context=context
    )
    errors = library("pyhanko_certvalidator.errors", EXTRA, WHERE)
    try:
        asyncio.run(validator.async_validate_path())
    except (errors.ValidationError, errors.PathError, ValueError) as problem:
        return " ".join(str(problem).split()).rstrip(".")
    return ""
