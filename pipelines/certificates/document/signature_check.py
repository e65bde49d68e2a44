"""Signatures of a certificate's files, checked from the file alone, and the XML that they cover with its statements."""

import base64
import re
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from typing import Any

from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509 import Certificate, load_der_x509_certificate

from pipelines.certificates.document.dcc import DCC, SI
from pipelines.certificates.document.signers import EXTRA, WHERE, Signer
from schemas.errors import DataRejected
from schemas.library import library

ATTACHMENT = "certificate.xml"
DSIG = "http://www.w3.org/2000/09/xmldsig#"
NUMBERS = "{https://ptb.de/si}*"
MOST_NAMES, LONGEST_NUMBER = 1000, 1000
SPACES = {"dcc": DCC, "si": SI}
ISSUED = re.compile(r"^Date of issue: (\d{4}-\d\d-\d\d)$")
COEFFICIENTS = re.compile(r"^SHA-256 of the table of (?:coefficients|procedure results): ([0-9a-f]{64})$")
DEEPEST = 20  # levels of the tree of attachments


class SignatureBroken(DataRejected):
    """An invalid signature, or a file that cannot be read in its stated format."""


def parsed(data: bytes) -> Any:
    """The root element of an XML document, without a network, entities or a document type.

    Raises
    ------
    SignatureBroken
        It is not such a document.
    """
    etree = library("lxml.etree", "pdf", WHERE)
    try:
        root = etree.fromstring(data, etree.XMLParser(no_network=True, resolve_entities=False, huge_tree=False))
    except etree.XMLSyntaxError as problem:
        raise SignatureBroken(f"it is not well-formed XML ({problem})") from None
    if root.getroottree().docinfo.doctype:
        raise SignatureBroken("it has a document type declaration, which a certificate does not need")
    _refuse_slow(data, root)
    return root


def _refuse_slow(data: bytes, root: Any) -> None:
    """Refuse XML on which canonical form or schema validation takes quadratic time, and which no certificate needs."""
    spaces = data.count(b"xmlns")
    if spaces > MOST_NAMES:
        raise SignatureBroken(f"it declares {spaces} namespaces, a certificate has at most {MOST_NAMES}")
    for element in root.iter(NUMBERS):
        if element.text is not None and len(element.text) > LONGEST_NUMBER:
            name = element.tag.rpartition("}")[2]
            raise SignatureBroken(f"{name} has {len(element.text)} characters, a number has at most {LONGEST_NUMBER}")
    for element in root.iter():
        if len(element.attrib) > MOST_NAMES:
            raise SignatureBroken(
                f"an element has {len(element.attrib)} attributes, one of a certificate at most {MOST_NAMES}"
            )


def canonical(root: Any) -> bytes:
    """An element in exclusive canonical form, which is equal for equivalent documents."""
    etree = library("lxml.etree", "pdf", WHERE)
    try:
        return etree.tostring(root, method="c14n", exclusive=True)
    except etree.C14NError as problem:
        raise SignatureBroken(
            f"it has no canonical form ({problem}): a namespace in it is not an absolute address"
        ) from None


def xml_signature(data: bytes) -> tuple[Signer, Any]:
    """The signer of an enveloping XML signature, and the root element of the document that the signature covers.

    Only what the signature returns is used: a second document beside the signed one is not looked at.

    Raises
    ------
    SignatureBroken
        The signature does not hold, names no certificate, or covers no document.
    """
    signxml = library("signxml", EXTRA, WHERE)
    root = parsed(data)
    if root.tag != f"{{{DSIG}}}Signature":
        raise SignatureBroken("it is not an XML signature")
    try:
        named = [
            load_der_x509_certificate(base64.b64decode(element.text or ""))
            for element in root.iterfind(f"{{{DSIG}}}KeyInfo/{{{DSIG}}}X509Data/{{{DSIG}}}X509Certificate")
        ]
    except ValueError as problem:
        raise SignatureBroken(f"the certificate in the signature cannot be read ({problem})") from None
    if not named:
        raise SignatureBroken("the signature names no certificate of its signer")
    pem = named[0].public_bytes(Encoding.PEM).decode()
    # the validity of the signer's certificate today is checked together with trust, for XML and PDF alike
    expected = signxml.SignatureConfiguration(
        location="./", require_x509=True, verification_time=named[0].not_valid_after_utc
    )
    with _read_as("the signature does not hold: {}"):
        good = signxml.XMLVerifier().verify(root, x509_cert=pem, expect_config=expected)
    inside = [] if good.signed_xml is None else list(good.signed_xml)
    if len(inside) != 1:
        raise SignatureBroken(f"the signature covers {len(inside)} documents, one is needed")
    return Signer(named[0], tuple(named[1:]), None), parsed(canonical(inside[0]))


def attachments(data: bytes) -> list[bytes]:
    """The attachments of a PDF that have the name of a certificate's XML.

    Raises
    ------
    SignatureBroken
        It cannot be read as a PDF.
    """
    reader = library("pyhanko.pdf_utils.reader", EXTRA, WHERE)
    with _read_as("it cannot be read as a PDF ({})"):
        document = reader.PdfFileReader(BytesIO(data))
        names = document.root.get("/Names", {}).get("/EmbeddedFiles", {})
        return [spec["/EF"]["/F"].data for name, spec in _named(names, DEEPEST) if name == ATTACHMENT]


def _named(tree: Any, levels: int) -> Iterator[tuple[str, Any]]:
    """Names and values of a name tree (ISO 32000-1, 7.9.6)."""
    names = tree.get("/Names", [])
    for index in range(0, len(names) - 1, 2):
        yield str(names[index]), names[index + 1]
    for child in tree.get("/Kids", []) if levels else []:
        yield from _named(child, levels - 1)


def pdf_signers(data: bytes) -> list[Signer]:
    """The signers of a PDF in order; empty for one without a signature.

    Raises
    ------
    SignatureBroken
        A signature does not hold, or something other than a further signature was added after it.
    """
    reader = library("pyhanko.pdf_utils.reader", EXTRA, WHERE)
    with _read_as("the signature of the PDF cannot be read ({})"):
        embedded = reader.PdfFileReader(BytesIO(data)).embedded_regular_signatures
        return [_pdf_signer(signature) for signature in embedded]


def _pdf_signer(embedded: Any) -> Signer:
    validation = library("pyhanko.sign.validation", EXTRA, WHERE)
    levels = library("pyhanko.sign.diff_analysis", EXTRA, WHERE).ModificationLevel
    context = library("pyhanko_certvalidator", EXTRA, WHERE).ValidationContext(
        trust_roots=[embedded.signer_cert], allow_fetching=False
    )  # trust is checked elsewhere: here the signature is checked against its own certificate
    status = validation.validate_pdf_signature(embedded, context)
    name = embedded.field_name
    if not status.intact:
        raise SignatureBroken(f"signature {name}: the signed bytes were changed after signing")
    if not status.valid:
        raise SignatureBroken(f"signature {name} is not of the key whose certificate it names")
    entire = status.coverage is validation.SignatureCoverageLevel.ENTIRE_FILE
    level = None if entire else status.modification_level
    if not entire and (level is None or level is levels.OTHER or level is levels.ANNOTATIONS or not status.docmdp_ok):
        raise SignatureBroken(f"signature {name} does not cover the whole file: something was added after signing")
    chain = tuple(_certificate(certificate) for certificate in embedded.other_embedded_certs)
    return Signer(_certificate(embedded.signer_cert), chain, status.signer_reported_dt)


def _certificate(certificate: Any) -> Certificate:
    return load_der_x509_certificate(certificate.dump())


@contextmanager
def _read_as(fault: str) -> Generator[None]:
    """A block that reads an untrusted file: any error of a reader becomes SignatureBroken with the text ``fault``."""
    try:
        yield
    except (SignatureBroken, MemoryError):  # the latter is of this machine: no verdict on the file
        raise
    except Exception as problem:  # noqa: BLE001 - see above
        cause = " ".join((str(problem) or type(problem).__name__).split())[:200]
        raise SignatureBroken(fault.format(cause)) from None


@dataclass(frozen=True)
class CertificateFacts:
    """Statements of a certificate's XML; empty texts if it does not make them.

    coefficients : SHA-256 of the certified table
    """

    number: str
    serial: str
    run: str
    issued: str
    coefficients: str
    simulated: bool


def facts_of(root: Any) -> CertificateFacts:
    """The statements of the root element of a certificate.

    Raises
    ------
    SignatureBroken
        It is not a Digital Calibration Certificate.
    """
    if root.tag != f"{{{DCC}}}digitalCalibrationCertificate":
        raise SignatureBroken(f"it is not a Digital Calibration Certificate: its root element is {root.tag}")
    texts = [text.strip() for text in statements(root)]
    core = "/*/dcc:administrativeData/dcc:coreData"
    run = f"{core}/dcc:identifications/dcc:identification[dcc:name/dcc:content='run']/dcc:value/text()"
    serial = (
        "/*/dcc:administrativeData/dcc:items/dcc:item/dcc:identifications/dcc:identification"
        "[dcc:name/dcc:content='serial number']/dcc:value/text()"
    )
    return CertificateFacts(
        number=first(root, f"{core}/dcc:uniqueIdentifier/text()"),
        serial=first(root, serial),
        run=first(root, run),
        issued=_matched(ISSUED, texts),
        coefficients=_matched(COEFFICIENTS, texts),
        simulated=any(text.startswith("SIMULATED") for text in texts),
    )


def statements(root: Any) -> list[str]:
    """The declarations of a document beside its results."""
    return _all(root, "//dcc:statement/dcc:declaration/dcc:content/text()")


def _all(root: Any, path: str) -> list[str]:
    return [str(text) for text in root.xpath(path, namespaces=SPACES)]


def first(root: Any, path: str) -> str:
    """The first text at a path; empty where there is none."""
    return next(iter(_all(root, path)), "")


def _matched(pattern: re.Pattern[str], lines: list[str]) -> str:
    return next((match[1] for line in lines if (match := pattern.match(line))), "")
