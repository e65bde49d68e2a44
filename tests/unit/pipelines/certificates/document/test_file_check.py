"""``tumbleline verify FILE``: what a receiver of a certificate is told of good, forged, cut, re-signed and revoked files."""

import base64
import hashlib
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib.resources import files
from io import BytesIO
from pathlib import Path

import pytest
from capture_double import AT_ROOM, small_run
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, utils
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, pkcs12
from each import each
from in_process import document_of, given, refused, text_of, typed_document
from laboratory import laboratory_file
from signing_keys import made_key, openssl_accepts, pem, self_signed

from pipelines.archive import Archive, Run
from pipelines.certificates import Calibration, Ledger
from pipelines.certificates.document import archive_comparison
from pipelines.certificates.document.compose import compose
from pipelines.certificates.document.content import CertificateContent
from pipelines.certificates.document.file_check import Against, check_file
from pipelines.certificates.document.issue import issue
from pipelines.certificates.document.laboratory import LaboratoryFile, read_laboratory
from pipelines.certificates.document.signature_check import canonical, parsed, xml_signature
from pipelines.certificates.document.signing import SigningKey, sign_pdf, sign_xml
from pipelines.chain.certify import certify

etree = pytest.importorskip("lxml.etree")
xmlschema = pytest.importorskip("xmlschema")
for name in ("typst", "signxml", "pyhanko"):
    pytest.importorskip(name)

DSIG = "http://www.w3.org/2000/09/xmldsig#"


@dataclass(frozen=True)
class Issued:
    """A certified run, the key of its laboratory, and a folder with the files of two certificates, signed; one unsigned."""

    run: Run
    key: SigningKey
    folder: Path
    trust: Path


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Issued:
    folder = tmp_path_factory.mktemp("issued")
    run = small_run(folder)
    run.seal()
    document_of("certificate", "issue", run.id, "--archive", run.archive.root)
    key = made_key(ec.generate_private_key(ec.SECP256R1()))
    who = laboratory_file(folder)
    (folder / "key.pem").write_bytes(pem(key))
    (folder / "trust.pem").write_bytes(key.certificate.public_bytes(Encoding.PEM))
    words = ("certificate", "write", run.id, "--laboratory", who, "--archive", run.archive.root, "--output")
    text_of(*words, folder / "unsigned", status=0)
    signed = ("--sign-with", folder / "key.pem", "--address", "https://example.org/{number}")
    text_of(*words, folder / "signed", *signed, status=0)
    return Issued(run, key, folder, folder / "trust.pem")


@pytest.fixture
def issued(made: Issued, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Issued:
    shutil.copytree(made.folder / "signed", tmp_path / "signed")
    monkeypatch.chdir(tmp_path)  # no archive here
    monkeypatch.delenv("TUMBLELINE_ARCHIVE", raising=False)
    return Issued(made.run, made.key, tmp_path / "signed", made.trust)


def checked(*words: object, status: int | None = None) -> dict:
    """The document that the command prints, of its type; ``status`` : that is expected."""
    code, out, _ = given("verify", *words, "--json")
    document = typed_document("verify", out)
    assert code == (0 if document["accepted"] else 1)
    assert status in {None, code}, out
    return document


def wrong(document: dict) -> dict[str, str]:
    """Messages of the checks that are bad, by check."""
    return {
        one["check"]: one["message"] for file in document["files"] for one in file["checks"] if one["state"] == "bad"
    }


def own_implementation_accepts(signature: bytes, key: SigningKey) -> bool:
    """XMLDSig by hand: digest of the canonical object, ECDSA over the canonical SignedInfo."""
    root = etree.fromstring(signature)
    signed = root.find(f"{{{DSIG}}}SignedInfo")
    value = base64.b64decode(root.findtext(f"{{{DSIG}}}SignatureValue"))
    half = len(value) // 2
    r, s = (int.from_bytes(part, "big") for part in (value[:half], value[half:]))
    method = signed.find(f"{{{DSIG}}}CanonicalizationMethod").get("Algorithm")
    assert method == "http://www.w3.org/2006/12/xml-c14n11", method
    public = key.certificate.public_key()
    assert isinstance(public, ec.EllipticCurvePublicKey)
    pair = utils.encode_dss_signature(r, s)
    try:
        public.verify(pair, etree.tostring(signed, method="c14n"), ec.ECDSA(hashes.SHA256()))
    except InvalidSignature:
        return False
    digest = base64.b64decode(signed.findtext(f".//{{{DSIG}}}DigestValue"))
    return digest == hashlib.sha256(etree.tostring(root.find(f"{{{DSIG}}}Object"), method="c14n")).digest()


def schema_accepts(document: bytes) -> bool:
    folder = files("pipelines.certificates.document") / "schemas"
    rules = xmlschema.XMLSchema(str(folder / "dcc.xsd"), locations={"https://ptb.de/si": str(folder / "SI_Format.xsd")},
                                allow="local")  # fmt: skip
    return rules.is_valid(BytesIO(document))


def test_signed_files_are_accepted_alone_with_the_archive_and_by_second_programs(
    issued: Issued, tmp_path: Path
) -> None:
    own = [issued.folder / f"A1_1.{end}" for end in ("pdf", "xml", "xml.sig")]
    assert not wrong(checked(own[0], status=1))  # a good signature of anybody proves nothing
    told = "nothing shows where the file comes from; give --trust FILE"
    assert told in text_of("verify", own[0], status=1)
    document = checked(*own, "--trust", issued.trust, status=0)
    assert [one["certificate"] for one in document["files"]] == ["A1/1"] * 3
    assert all(one["proven_by"] == ["signature"] for one in document["files"])
    assert openssl_accepts(own[0].read_bytes(), issued.trust, tmp_path)
    assert own_implementation_accepts(own[2].read_bytes(), issued.key)
    assert schema_accepts(own[1].read_bytes())
    words = (own[0], "--trust", issued.trust, "--archive", issued.run.archive.root)
    checks = {one["check"]: one for one in checked(*words, status=0)["files"][0]["checks"]}
    assert checks["archive"]["state"] == checks["state"]["state"] == "good"
    assert int(checks["archive"]["message"].split()[0]) > 20
    assert "not proven by the archive: laboratory: Example Sensor Works" in checks["laboratory"]["message"]
    Archive(tmp_path / "archive").prepare()  # of somebody else, who receives the certificate
    document = checked(own[0], "--trust", issued.trust, status=0)
    assert "has no certificate A1/1" in json.dumps(document)


def test_an_unsigned_xml_is_proven_by_the_archive_with_the_laboratorys_file_and_an_unsigned_pdf_is_not(
    made: Issued, issued: Issued
) -> None:
    folder, archive = made.folder / "unsigned", ("--archive", issued.run.archive.root)
    alone = checked(folder / "A1_1.xml", *archive, status=1)
    assert not wrong(alone)
    assert "Example Drones Ltd" in json.dumps(alone)
    printed = text_of("verify", folder / "A1_1.xml", *archive, status=1)
    assert "names and addresses are not proven by the archive: give --laboratory FILE" in printed
    archive = (*archive, "--laboratory", made.folder / "laboratory.toml")
    assert checked(folder / "A1_1.xml", *archive, status=0)["files"][0]["proven_by"] == ["archive"]
    document = checked(folder / "A1_1.pdf", *archive, status=1)
    assert not wrong(document)
    assert "nothing shows that its pages are unchanged" in json.dumps(document)
    checked(folder / "A1_1.xml", status=1)


def altered(xml: bytes) -> list[tuple[str, bytes]]:
    """The document with one text node or attribute altered, for each of them, and with a comment in front."""
    root = etree.fromstring(xml)
    out = [("comment", xml.replace(b"<dcc:digital", b"<!-- -->\n<dcc:digital", 1))]
    for one in root.iter():
        for part in ("text", *one.attrib):
            old = one.attrib.get(part, one.text)
            new = f"{(old or '')[:-1]}{'1' if (old or '')[-1:] != '1' else '2'}"
            if part in one.attrib:
                one.set(part, new)
            else:
                one.text = new
            out.append((f"{one.tag.rpartition('}')[2]} {part}: {old!r:.40}", etree.tostring(root)))
            if part in one.attrib:
                one.set(part, old)
            else:
                one.text = old
    return out


@pytest.mark.slow
def test_no_altered_text_or_attribute_is_accepted_by_the_archive(
    made: Issued, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Alone or with the laboratory's file. The archive stays as it is: what it says is read once."""
    archive = Archive(made.run.archive.root)
    every = altered((made.folder / "unsigned" / "A1_1.xml").read_bytes())
    assert len(every) > 290
    who, composed, known = read_laboratory(made.folder / "laboratory.toml"), {}, Ledger(archive).calibrations("A1")

    def once(run: Run, one: Calibration, all_known: list[Calibration], by: LaboratoryFile) -> CertificateContent:
        key = (one.certificate, by.model_dump_json())
        if key not in composed:
            composed[key] = compose(run, one, all_known, by)
        return composed[key]

    monkeypatch.setattr(archive_comparison, "compose", once)
    monkeypatch.setattr(Ledger, "calibrations", lambda _self, serial: known if serial == "A1" else [])
    path = tmp_path / "altered.xml"
    accepted: list[str] = []
    for name, data in every:
        path.write_bytes(data)
        against = (Against((), archive, demanded=True), Against((), archive, True, who))
        accepted += [name for one in against if check_file(path, one).accepted]
    assert accepted == []


FORGERIES = (
    (b"no device was measured", b"a device was measured", ""),
    (b"SIMULATED: ", b"Measured: ", ""),
    (b"guard", b"no guard", ""),
    (b"Example Sensor Works", b"Accredited Sensor Works", "speaks of accreditation"),
)


@each(FORGERIES)
def test_a_forged_statement_condition_or_rule_is_named_by_the_archive(
    forgery: tuple[bytes, bytes, str], issued: Issued, tmp_path: Path
) -> None:
    old, new, said = forgery
    xml = (issued.folder / "A1_1.xml").read_bytes()
    assert old in xml
    (tmp_path / "forged.xml").write_bytes(xml.replace(old, new, 1))
    found = checked(tmp_path / "forged.xml", "--archive", issued.run.archive.root, status=1)
    assert said in wrong(found)["archive"]


def test_a_name_that_was_changed_is_never_proven_and_found_with_the_laboratorys_file(
    issued: Issued, made: Issued, tmp_path: Path
) -> None:
    xml = (issued.folder / "A1_1.xml").read_bytes()
    (tmp_path / "forged.xml").write_bytes(xml.replace(b"Example Drones Ltd", b"Somebody Else Ltd"))
    words = (tmp_path / "forged.xml", "--archive", issued.run.archive.root)
    assert "customer: Somebody Else Ltd" in json.dumps(checked(*words, status=1))
    found = wrong(checked(*words, "--laboratory", made.folder / "laboratory.toml", status=1))
    assert "the file says 'Somebody Else Ltd', the archive 'Example Drones Ltd'" in found["archive"]


def changed_digit(xml: bytes) -> bytes:
    """The XML with another first digit of the first value of a result."""
    place = xml.index(b"<si:value>", xml.index(b"<dcc:results>")) + len(b"<si:value>")
    place += xml[place : place + 1] == b"-"
    digit = b"1" if xml[place : place + 1] != b"1" else b"2"
    return xml[:place] + digit + xml[place + 1 :]


def test_every_changed_byte_of_a_signed_pdf_is_found_as_by_openssl(issued: Issued, tmp_path: Path) -> None:
    path = issued.folder / "A1_1.pdf"
    whole = path.read_bytes()
    hidden = whole.rindex(b"/Contents")
    for place in (60, len(whole) // 3, len(whole) // 2, hidden - 200):
        data = whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :]
        path.write_bytes(data)
        assert wrong(checked(path, "--trust", issued.trust, status=1)), place
        assert not openssl_accepts(data, issued.trust, tmp_path)


def test_what_is_added_after_signing_is_found(issued: Issued, tmp_path: Path) -> None:
    """The attached XML replaced, and a page's text covered, by an incremental update: the signed bytes are untouched."""
    from pyhanko.pdf_utils import generic
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

    path = issued.folder / "A1_1.pdf"
    signed = path.read_bytes()
    for kind in ("attachment", "page"):
        writer = IncrementalPdfFileWriter(BytesIO(signed))
        if kind == "attachment":
            spec = writer.root["/Names"]["/EmbeddedFiles"]["/Names"][1]
            stream = generic.StreamObject(stream_data=changed_digit(spec["/EF"]["/F"].data))
            spec["/EF"]["/F"] = writer.add_object(stream)
            writer.update_container(spec["/EF"])
        else:
            writer.add_stream_to_page(0, writer.add_object(generic.StreamObject(stream_data=b"q 0 0 99 99 re f Q")))
        out = BytesIO()
        writer.write(out)
        assert out.getvalue().startswith(signed)
        path.write_bytes(out.getvalue())
        found = wrong(checked(path, "--trust", issued.trust, status=1))
        assert "something was added after signing" in found["signature"]
        assert not openssl_accepts(out.getvalue(), issued.trust, tmp_path)


def test_a_second_signature_of_the_receiver_leaves_the_first_good(issued: Issued) -> None:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
    from pyhanko.sign import PdfSignatureMetadata, PdfSigner, SimpleSigner

    receiver = made_key(ec.generate_private_key(ec.SECP256R1()))
    pair = pkcs12.serialize_key_and_certificates(None, receiver.key, receiver.certificate, None, NoEncryption())
    out, path = BytesIO(), issued.folder / "A1_1.pdf"
    signer = SimpleSigner.load_pkcs12_data(pair, other_certs=[], passphrase=None)
    meta = PdfSignatureMetadata(field_name="Received", md_algorithm="sha256")
    PdfSigner(meta, signer=signer).sign_pdf(IncrementalPdfFileWriter(BytesIO(path.read_bytes())), output=out)
    path.write_bytes(out.getvalue())
    assert len(checked(path, "--trust", issued.trust, status=0)["files"][0]["signers"]) == 2


def test_files_signed_again_by_another_key_are_found(issued: Issued, made: Issued) -> None:
    forger = made_key(ec.generate_private_key(ec.SECP256R1()))
    xml = changed_digit((issued.folder / "A1_1.xml").read_bytes())
    (issued.folder / "A1_1.xml").write_bytes(xml)
    (issued.folder / "A1_1.xml.sig").write_bytes(sign_xml(xml, forger))
    (issued.folder / "A2_1.pdf").write_bytes(sign_pdf((made.folder / "unsigned" / "A2_1.pdf").read_bytes(), forger))
    for name in ("A1_1.xml", "A1_1.xml.sig", "A2_1.pdf"):
        document = checked(issued.folder / name, "--trust", issued.trust, status=1)
        assert "no certificate of --trust vouches for" in wrong(document)["signer"]
        assert document["files"][0]["proven_by"] == []
    archive = ("--archive", issued.run.archive.root)
    assert "the file says" in wrong(checked(issued.folder / "A1_1.xml", *archive, status=1))["archive"]


def test_a_document_beside_the_signed_one_is_not_taken_for_it(issued: Issued) -> None:
    """Wrapping: a forged document is put into the signature's file, before and after the signed one."""
    path = issued.folder / "A1_1.xml.sig"
    good, signed = path.read_bytes(), (issued.folder / "A1_1.xml").read_bytes()
    forged = etree.fromstring(changed_digit(signed))
    for index in (0, -1):
        root = etree.fromstring(good)
        box = etree.Element(f"{{{DSIG}}}Object", Id="object")
        box.append(forged)
        root.insert(index, box) if index == 0 else root.append(box)
        path.write_bytes(etree.tostring(root))
        if checked(path, "--trust", issued.trust)["accepted"]:  # then it is for the document that was signed
            assert canonical(xml_signature(path.read_bytes())[1]) == canonical(parsed(signed))
        (path.parent / "forged.xml").write_bytes(etree.tostring(forged))
        shutil.copy(path, path.parent / "forged.xml.sig")
        assert checked(path.parent / "forged.xml", "--trust", issued.trust, status=1)["files"][0]["proven_by"] == []


@pytest.mark.parametrize("name", ["A1_1.pdf", "A1_1.xml", "A1_1.xml.sig"])
def test_a_file_that_is_cut_or_holds_other_bytes_is_wrong_and_never_a_traceback(name: str, issued: Issued) -> None:
    path = issued.folder / name
    whole, bomb = path.read_bytes(), b'<!DOCTYPE a [<!ENTITY b "bb">]><a>&b;</a>'
    cut = [whole[: min(int(share * len(whole)), len(whole) - 10)] for share in (0.0, 0.01, 0.5, 0.95, 0.9999)]
    for data in (*cut, b"%PDF-1.7\n", b"\x00\xff" * 500, b"<a/>", bomb, b"<a><b></a>"):
        path.write_bytes(data)
        assert wrong(checked(path, "--trust", issued.trust, status=1)), (len(data), data[:20])


def test_an_attachment_or_a_digit_that_differs_is_found_by_signature_archive_and_the_other_implementation(
    issued: Issued,
) -> None:
    shutil.copy(issued.folder / "A2_1.xml", issued.folder / "A1_1.xml")
    messages = wrong(checked(issued.folder / "A1_1.pdf", "--trust", issued.trust, status=1))
    assert messages == {"attachment": "the attached XML differs from A1_1.xml"}
    xml, signature = (issued.folder / f"A1_1.{end}" for end in ("xml", "xml.sig"))
    xml.write_bytes(changed_digit(xml.read_bytes()))
    messages = wrong(checked(xml, "--trust", issued.trust, status=1))
    assert messages == {"signature": "A1_1.xml.sig signs another document than this file"}
    signature.write_bytes(changed_digit(signature.read_bytes()))
    assert "does not hold" in wrong(checked(signature, "--trust", issued.trust, status=1))["signature"]
    assert not own_implementation_accepts(signature.read_bytes(), issued.key)
    signature.unlink()
    assert "the file says" in wrong(checked(xml, "--archive", issued.run.archive.root, status=1))["archive"]


def test_an_xml_that_the_schema_does_not_allow_is_found_as_by_the_second_program(issued: Issued) -> None:
    xml = (issued.folder / "A1_1.xml").read_bytes()
    path = issued.folder / "other.xml"
    for bad in (xml.replace(b"<dcc:mainSigner>true</dcc:mainSigner>", b"<dcc:mainSigner>yes</dcc:mainSigner>"),
                xml.replace(b"<dcc:eMail>calibration@example.com</dcc:eMail>", b"")):  # fmt: skip
        path.write_bytes(bad)
        path.with_name("other.xml.sig").write_bytes(sign_xml(bad, issued.key))
        assert "is not valid against DCC 3.0.0" in wrong(checked(path, "--trust", issued.trust, status=1))["schema"]
        assert not schema_accepts(bad)
    path.write_bytes(xml.replace(b'schemaVersion="3.0.0"', b'schemaVersion="3.3.0"'))
    path.with_name("other.xml.sig").unlink()
    states = {one["check"]: one["state"] for one in checked(path, status=1)["files"][0]["checks"]}
    assert states["schema"] == "not checked"


def test_revoked_amended_and_unknown_certificates_are_told_by_the_archive(issued: Issued, tmp_path: Path) -> None:
    shutil.copytree(str(issued.run.archive.root), tmp_path / "copy")
    archive = Archive(tmp_path / "copy")
    words = ("--trust", issued.trust, "--archive", tmp_path / "copy")
    Ledger(archive).revoke("A1", "dropped on the floor")
    certify(Ledger(archive), archive.run(issued.run.id), ["A2"], months=6, reason="validity corrected")
    revoked = wrong(checked(issued.folder / "A1_1.pdf", *words, status=1))
    assert set(revoked) == {"state"}
    assert re.fullmatch(r"revoked on .*dropped on the floor", revoked["state"])
    amended = wrong(checked(issued.folder / "A2_1.xml", *words, status=1))
    assert "amended and replaced by certificate A2/2" in amended["state"]
    shutil.rmtree(tmp_path / "copy" / "calibrations")
    unknown = wrong(checked(issued.folder / "A1_1.xml", *words, status=1))
    assert "has no certificate A1/1 of unit A1" in unknown["archive"]


@pytest.mark.slow
def test_a_certificate_superseded_by_a_later_run_is_told_and_the_later_one_stays_the_same_when_it_is_revoked(
    issued: Issued, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(str(issued.run.archive.root), tmp_path / "archive")
    later, who = small_run(tmp_path, None, ("seed = 5", "seed = 6"), *AT_ROOM), laboratory_file(tmp_path)
    later.seal()
    assert later.id != issued.run.id
    now, ledger = datetime.now(tz=UTC).date(), Ledger(later.archive)
    begins = (now + timedelta(days=40)).isoformat()
    number = certify(ledger, later, ["A1"], begins, months=6).events[0].certificate
    words = ("--trust", issued.trust, "--archive", tmp_path / "archive")
    for name in ("A1_1.pdf", "A1_1.xml"):
        told = f"superseded by certificate {number} on {now}, not valid from {begins} on"
        with_it = checked(issued.folder / name, *words, status=0)  # until that day it is valid
        assert told in [one["message"] for one in with_it["files"][0]["checks"] if one["check"] == "state"]
        with monkeypatch.context() as later_day:
            later_day.setattr("pipelines.certificates.document.archive_comparison.today", lambda: begins)
            assert wrong(checked(issued.folder / name, *words, status=1)) == {"state": told}
    assert checked(issued.folder / "A2_1.xml", *words)["accepted"]  # the other unit's certificate stands
    issue(later.archive, ["A1/2"], read_laboratory(who), tmp_path)
    ledger.revoke("A1", "dropped on the floor", certificate=1)
    # as found: what the earlier coefficients made of these readings on the day of issue stays said
    words = (tmp_path / "A1_2.xml", "--archive", later.archive.root, "--laboratory", who)
    assert checked(*words, status=0)["files"][0]["proven_by"] == ["archive"]


def test_a_certificate_of_an_authority_vouches_for_the_laboratories_that_it_named(issued: Issued, made: Issued) -> None:
    root, other = (self_signed("Example Authority", -400, 30, authority=True) for _ in range(2))
    document = (made.folder / "unsigned" / "A1_1.pdf").read_bytes()
    path, trust = issued.folder / "A1_1.pdf", issued.folder / "authority.pem"
    xml = (issued.folder / "A1_1.xml").read_bytes()
    signatures: list[Callable[[SigningKey], int]] = [
        lambda k: path.write_bytes(sign_pdf(document, k)),
        lambda k: path.with_name("A1_1.xml.sig").write_bytes(sign_xml(xml, k)),
    ]
    for begins, ends, good in ((-1, 30, True), (-90, -60, False)):
        leaf = self_signed("Example Sensor Works", begins, ends, issuer=root)
        for sign in signatures:
            sign(leaf)
        for file in (path, path.with_name("A1_1.xml.sig")):
            for authority, vouches in ((root, True), (other, False)):
                trust.write_bytes(authority.certificate.public_bytes(Encoding.PEM))
                assert checked(file, "--trust", trust)["accepted"] is (good and vouches), (file.name, begins, vouches)


def test_an_expired_key_does_not_sign_and_vouches_for_nothing_even_where_it_is_trusted_itself(
    issued: Issued, made: Issued, tmp_path: Path
) -> None:
    old, trust = self_signed("Example Sensor Works", -400, -369), tmp_path / "trust.pem"
    (tmp_path / "old.pem").write_bytes(pem(old))
    words = ("certificate", "write", made.run.id, "--laboratory", made.folder / "laboratory.toml", "--archive")
    words += (made.run.archive.root, "--output", tmp_path / "out", "--sign-with", tmp_path / "old.pem")
    assert "nothing was signed: renew it" in refused(*words)
    assert not (tmp_path / "out").exists()
    trust.write_bytes(old.certificate.public_bytes(Encoding.PEM))
    (tmp_path / "A1_1.xml.sig").write_bytes(sign_xml((issued.folder / "A1_1.xml").read_bytes(), old))
    (tmp_path / "A1_1.pdf").write_bytes(sign_pdf((made.folder / "unsigned" / "A1_1.pdf").read_bytes(), old))
    for name, why in (("A1_1.xml.sig", "states no time"), ("A1_1.pdf", "is the signer's own statement")):
        found = wrong(checked(tmp_path / name, "--trust", trust, status=1))
        assert "nothing proves that it was signed before" in found["signer"]
        assert why in found["signer"]
    good = checked(issued.folder / "A1_1.pdf", "--trust", issued.trust, status=0)
    assert "is the signer's own statement, without a time stamp" in json.dumps(good)


def test_wrong_use_is_told(issued: Issued, tmp_path: Path) -> None:
    (tmp_path / "none.pem").write_text("nothing", encoding="utf-8")
    pdf = issued.folder / "A1_1.pdf"
    for words, why in (
        ((pdf, "latest"), "give files or runs, not both"),
        ((tmp_path / "missing.pdf",), "is not there"),
        ((pdf, "--trust", tmp_path / "none.pem"), "holds no certificate that can be read"),
        (("latest", "--laboratory", tmp_path), "no file of a certificate is given"),
    ):
        assert why in refused("verify", *words)
