"""Signed certificates, checked from the file alone: by the validators of pyHanko and signxml, and by ``openssl cms``."""

from io import BytesIO
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, Encoding, pkcs12
from signing_keys import made_key, openssl_accepts, pem

from pipelines.certificates.document.signing import SigningKey, read_key, sign_pdf, sign_xml
from schemas.errors import WrongUse

etree = pytest.importorskip("lxml.etree")
typst = pytest.importorskip("typst")
signxml = pytest.importorskip("signxml")
pytest.importorskip("pyhanko")

XML = b'<a xmlns="urn:example"><b>1.250</b></a>'


@pytest.fixture(scope="module", params=["P-256", "RSA"])
def signing(request: pytest.FixtureRequest) -> SigningKey:
    private = (
        ec.generate_private_key(ec.SECP256R1()) if request.param == "P-256" else rsa.generate_private_key(65537, 2048)
    )
    return made_key(private)


def test_the_pdf_is_intact_and_trusted_for_two_programs(signing: SigningKey, tmp_path: Path) -> None:
    from pyhanko.keys import load_certs_from_pemder_data
    from pyhanko.pdf_utils.reader import PdfFileReader
    from pyhanko.sign.validation import validate_pdf_signature
    from pyhanko_certvalidator import ValidationContext

    document = typst.Compiler(b"certificate A1/1").compile(format="pdf", pdf_standards="a-3b", timestamp=0)
    signed, trust = sign_pdf(document, signing), tmp_path / "root.pem"
    trust.write_bytes(signing.certificate.public_bytes(Encoding.PEM))
    context = ValidationContext(trust_roots=list(load_certs_from_pemder_data(trust.read_bytes())))

    good = validate_pdf_signature(PdfFileReader(BytesIO(signed)).embedded_signatures[0], context)
    assert (good.intact, good.valid, good.trusted) == (True, True, True)
    assert str(good.coverage).endswith("ENTIRE_FILE")
    assert b"/ETSI.CAdES.detached" in signed  # PAdES
    assert signed.startswith(document)  # an incremental update: what was typeset is in it unchanged
    assert openssl_accepts(signed, trust, tmp_path)


def test_the_xml_is_in_its_signature_and_a_changed_digit_is_found(signing: SigningKey) -> None:
    signature = sign_xml(XML, signing)
    how = {"expect_config": signxml.SignatureConfiguration(location="./", require_x509=True)}
    how["x509_cert"] = signing.certificate.public_bytes(Encoding.PEM).decode()
    good = signxml.XMLVerifier().verify(etree.fromstring(signature), **how)
    assert b"<b>1.250</b>" in good.signed_data
    with pytest.raises(signxml.exceptions.InvalidDigest):
        signxml.XMLVerifier().verify(etree.fromstring(signature.replace(b"1.250", b"1.251")), **how)


def test_keys_are_read_from_pem_and_pkcs12_and_what_is_none_is_refused(signing: SigningKey, tmp_path: Path) -> None:
    (tmp_path / "key.pem").write_bytes(pem(signing))
    assert read_key(tmp_path / "key.pem").certificate == signing.certificate
    data = pkcs12.serialize_key_and_certificates(
        b"n", signing.key, signing.certificate, None, BestAvailableEncryption(b"pw")
    )
    (tmp_path / "key.p12").write_bytes(data)
    (tmp_path / "password").write_text("pw\n")
    assert read_key(tmp_path / "key.p12", tmp_path / "password").certificate == signing.certificate
    foreign = made_key(ec.generate_private_key(ec.SECP256R1())).certificate
    (tmp_path / "other.pem").write_bytes(pem(SigningKey(signing.key, foreign, ())))
    (tmp_path / "bare.pem").write_bytes(pem(signing).split(b"-----BEGIN CERT", maxsplit=1)[0])
    (tmp_path / "none.p12").write_text("nothing")
    for name, why in (
        ("key.p12", "is no key that can be used"),
        ("other.pem", "the first certificate is not that of the key"),
        ("bare.pem", "is no key that can be used"),
        ("none.p12", "is no key that can be used"),
        ("missing.pem", "cannot be read"),
    ):
        with pytest.raises(WrongUse, match=why):
            read_key(tmp_path / name)
