"""The certificate that is handed out: what ISO/IEC 17025 lists is on it, what must not be said is not, its XML is valid."""

import html
import itertools
import json
import re
import shutil
import tomllib
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from capture_double import AT_ROOM, small_run
from in_process import document_of, refused
from in_process import text_of as printed
from laboratory import LABORATORY, laboratory_file
from pydantic import ValidationError

from pipelines.archive import Archive, Run
from pipelines.certificates import Ledger
from pipelines.certificates.document import compose as composing
from pipelines.certificates.document.circumstances import _static_method, standard_of, traceability
from pipelines.certificates.document.compose import compose
from pipelines.certificates.document.content import CertificateContent, Coefficient, ReferenceStandard
from pipelines.certificates.document.dcc import DCC, SI, dcc, validate
from pipelines.certificates.document.issue import pdf
from pipelines.certificates.document.laboratory import LaboratoryFile, read_laboratory
from pipelines.certificates.document.numbers import si_unit, with_uncertainty
from pipelines.certificates.document.pages import page_content
from pipelines.certificates.stated_budget import StatedBudget
from pipelines.chain.certify import certify
from pipelines.report.numbers import with_uncertainty as report_rounding
from pipelines.report.unit_panels.budget import render as budget_panel
from schemas.errors import RecipeInvalid, WrongUse
from schemas.reference import Reference

etree = pytest.importorskip("lxml.etree")
pytest.importorskip("typst")
pikepdf = pytest.importorskip("pikepdf")
pdfplumber = pytest.importorskip("pdfplumber")

Typed = Callable[..., tuple[object, ...]]
NAMES = {"dcc": DCC, "si": SI}
ACCREDITATION = '[laboratory.accreditation]\nbody = "DAkkS"\nnumber = "D-K-00000-01"\n'


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Run:
    run = small_run(tmp_path_factory.mktemp("run"), {"A3": "silent"})
    run.seal()
    certify(Ledger(run.archive), run)
    return run


@pytest.fixture(scope="module")
def c(made: Run) -> CertificateContent:
    return content(made)


@pytest.fixture(scope="module")
def xml(c: CertificateContent) -> bytes:
    return dcc(c)


@pytest.fixture(scope="module")
def paper(c: CertificateContent, xml: bytes) -> bytes:
    return pdf(c, xml)


@pytest.fixture
def run(made: Run, tmp_path: Path) -> Run:
    shutil.copytree(made.archive.root, tmp_path / "archive")
    return Archive(tmp_path / "archive").run(made.id)


@pytest.fixture
def typed(run: Run, tmp_path: Path) -> Typed:
    """The words of the command that writes certificates."""
    own = ("--laboratory", laboratory_file(tmp_path), "--output", tmp_path / "out", "--archive", run.archive.root)
    return lambda *words: ("certificate", "write", *words, *own)


def content(run: Run, serial: str = "A1", text: str = LABORATORY) -> CertificateContent:
    known = Ledger(run.archive).calibrations(serial)
    return compose(run, known[-1], known, LaboratoryFile.model_validate(tomllib.loads(text)))


def found(xml: bytes, path: str) -> list:
    """What is at a path of a document."""
    return etree.fromstring(xml).xpath(path, namespaces=NAMES)


def text_of(document: bytes) -> list[str]:
    """The text of every page, by a program that is not the one that wrote it."""
    with pdfplumber.open(BytesIO(document)) as pages:
        return [page.extract_text() for page in pages.pages]


def test_a_run_gives_a_pdf_and_an_xml_per_certified_unit_and_names_those_without(
    run: Run, typed: Typed, tmp_path: Path
) -> None:
    document = document_of(*typed(run.id), status=1)
    assert [one["certificate"] for one in document["certificates"]] == ["A1/1", "A2/1"]
    assert "refused, no certificate: stopped answering" in document["left_out"]["A3"]
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["A1_1.pdf", "A1_1.xml", "A2_1.pdf", "A2_1.xml"]
    validate((tmp_path / "out" / "A2_1.xml").read_bytes())


def test_a_certificate_has_the_same_bytes_again_and_none_is_made_of_what_has_or_holds_none(
    run: Run, typed: Typed, tmp_path: Path
) -> None:
    told = r"unit A3 has no certificate, one is needed; run .*: refused, no certificate: stopped"
    assert re.search(told, refused(*typed("A1", "A3")))
    assert not (tmp_path / "out").exists()  # not even that of A1
    assert "A1/7 is not in the ledger, there are A1/1" in refused(*typed("A1/7"))
    made = []
    for words in ("A1", "A1/1"):
        printed(*typed(words), status=0)
        made.append({path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()})
    assert made[0] == made[1]
    printed("certificate", "revoke", "A1", "--reason", "dropped", "--archive", run.archive.root, status=0)
    assert re.search(r"certificate A1/1 of run .* was revoked \(dropped\)", refused(*typed("A1")))


def test_no_document_is_made_of_a_run_that_was_edited_after_it_was_certified(
    run: Run, typed: Typed, tmp_path: Path
) -> None:
    edits = ("run", "simulated", "hardware"), ("budget", "sha256", "sha265"), ("sealed", '"entry": 1', '"entry": 9')
    for name, old, new in edits:
        path = run.path / f"{name}.json"
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace(old, new), encoding="utf-8")
        assert path.read_text(encoding="utf-8") != text
        assert "restore" in refused(*typed("A1"), status=2), name
        path.unlink()
        assert "restore" in refused(*typed("A1"), status=2), name
        path.write_text(text, encoding="utf-8")
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_an_amendment_an_accreditation_and_an_interval_that_the_customer_agreed_to_are_on_paper_and_not_without_them(
    run: Run, xml: bytes, paper: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = " ".join(text_of(paper))
    assert not re.search("accredit", plain + xml.decode(), re.IGNORECASE)
    assert Ledger(run.archive).calibrations("A1")[-1].until not in plain
    again = certify(Ledger(run.archive), run, ["A1"], months=6, reason="validity corrected to six months")
    assert again.written[0].certificate == "A1/2"
    real = composing.stated_budget
    monkeypatch.setattr(composing, "stated_budget", lambda *a: replace(real(*a), customer_agreed=True))
    known = Ledger(run.archive).calibrations("A1")
    new = content(run, text=LABORATORY + ACCREDITATION)
    written = " ".join(" ".join(text_of(pdf(new, dcc(new)))).split())
    assert "amends and replaces certificate A1/1. Change: validity corrected to six months" in written
    assert "D-K-00000-01 (DAkkS)" in written
    assert f"As agreed with the customer, the next calibration is due on {known[-1].until}" in written
    assert known[-1].until in dcc(new).decode()
    old = compose(run, known[0], known, new.who)
    assert old.number == "A1/1"
    assert "was replaced by certificate A1/2" in json.dumps(page_content(old))


def test_every_item_of_7_8_2_and_7_8_4_is_on_paper_and_in_the_xml(xml: bytes, paper: bytes) -> None:
    pages = text_of(paper)
    printed = " ".join(" ".join(pages).split())
    for part in (
        "Calibration certificate", "Example Sensor Works", "Am Kornfeld 7", "the laboratory named above", "A1/1",
        "Example Drones Ltd", "quality@example.org", "Static multi-position calibration",
        "Accelerometer, Analog Devices, adxl355", "Date of calibration", "Date of issue", "relate only to the item",
        "J. Example, Head of calibration",
        "Conditions", "9.81230 m/s²", "0.0 to 50.0 °C", "traceability", "No earlier calibration", "coverage factor",
        "ILAC-G8:09/2019 guarded acceptance", "PFA", "End of certificate",
    ):  # fmt: skip
        assert part in printed, part
    for path in (
        "//dcc:uniqueIdentifier[.='A1/1']", "//dcc:customer", "//dcc:respPerson/dcc:mainSigner", "//dcc:usedMethod/dcc:norm",
        "//dcc:item/dcc:identifications", "//dcc:influenceCondition", "//si:expandedUnc/si:coverageFactor",
        "//dcc:metaData/dcc:conformity[.='pass']", "//dcc:performanceLocation",
    ):  # fmt: skip
        assert found(xml, path), path
    assert [f"page {n} of {len(pages)}" in page for n, page in enumerate(pages, 1)] == [True] * len(pages)


def test_a_budget_adds_up_and_names_contributions_sources_and_effects_in_words_and_not_by_keys(
    c: CertificateContent, paper: bytes
) -> None:
    assert {one.k is None for one in c.budgets} == {True, False}  # the error over the period is a standard deviation
    for one in c.budgets:
        if one.k is None:
            assert np.sqrt(sum(row.u**2 for row in one.rows)) == pytest.approx(one.u, rel=2e-3)
        assert all("[" not in row.source for row in one.rows)
    named = {row.name for table in c.budgets for row in table.rows}
    assert {"noise of the dwells", "repeatability of the poses", "seat of the fixture"} <= named, named
    assert "simulation: rotation of the slots" in {row.source for table in c.budgets for row in table.rows}
    text = " ".join(text_of(paper))
    assert "bias temperature" in text
    for key in ("bias_temperature", "slot_rotation_mrad", "switch_on", "scale_temperature"):
        assert key not in text.replace("\n", "")


def test_a_standard_deviation_has_no_uncertainty_on_paper_in_xml_and_in_the_archive(
    made: Run, c: CertificateContent, xml: bytes
) -> None:
    assert min(float(one.text) for one in found(xml, "//si:expandedUnc/si:uncertainty")) > 0.0
    words = "to be expected over the stated period"
    own = found(xml, f"//dcc:result[contains(dcc:name/dcc:content, '{words}')]")
    assert len(own) == 3
    for one in own:
        assert one.find(".//si:value", NAMES) is not None
        assert one.find(".//si:expandedUnc", NAMES) is None
    [table] = [table for part in page_content(c)["parts"] if part.get("title") == "Results" for table in part["tables"]]
    rows = [row for row in table["rows"] if words in row[0]]
    assert [(row[3], row[5]) for row in rows] == [("", "")] * 3
    of_period = made.table("uncertainties").query("quantity.str.contains('period|largest')")
    assert len(of_period)
    assert of_period[["dof", "k", "expanded"]].isna().all(axis=None)
    panel = budget_panel(SimpleNamespace(tables={"uncertainties": made.table("uncertainties")})) or ""
    assert "bias_error" not in panel
    assert ">0<" not in panel


def test_values_of_the_xml_are_those_of_the_archive_in_si_units(made: Run, xml: bytes) -> None:
    row = made.table("uncertainties").query("unit == 'A1' and quantity == 'bias' and axis == 'y'").iloc[0]
    own = found(xml, "//dcc:result[dcc:name/dcc:content[contains(.,'bias at') and contains(.,', y')]]//si:real")
    printed = [float(own[0].findtext(f".//{{{SI}}}{name}")) for name in ("value", "uncertainty")]
    np.testing.assert_allclose(printed, [row["value"] * 9.80665e-6, row["expanded"] * 9.80665e-6], rtol=1e-14)
    assert own[0].findtext(f"{{{SI}}}unit") == r"\metre\second\tothe{-2}"
    stated = made.table("coefficients").query("unit == 'A1' and effect == 'scale' and axis == 'x'").iloc[0]
    name = "sensitivity at the reference temperature, x"
    scale = found(xml, f"//dcc:result[dcc:name/dcc:content[.='{name}']]//si:value")
    assert float(scale[0].text) == pytest.approx(stated["value"] / 9.80665, rel=1e-14)
    assert si_unit("LSB/g") == (r"\metre\tothe{-1}\second\tothe{2}", pytest.approx(1 / 9.80665))
    assert si_unit("µg") == (r"\metre\second\tothe{-2}", pytest.approx(9.80665e-6))
    assert si_unit("LSB/(g·K)")[0] == r"\metre\tothe{-1}\second\tothe{2}\kelvin\tothe{-1}"
    assert si_unit("furlong") is None


def test_as_found_is_what_the_earlier_coefficients_make_of_the_readings_of_today(tmp_path: Path) -> None:
    first = small_run(tmp_path)
    first.seal()
    certify(Ledger(first.archive), first, ["A1"])
    second = small_run(tmp_path, None, ('"small"', '"later"'), *AT_ROOM)
    # the earlier certificate was given for coefficients of a device that has moved since: here the table's bias is moved
    table = first.table("coefficients")
    second.seal()
    certify(Ledger(first.archive), second, ["A1"], supersede=True)
    known = Ledger(first.archive).calibrations("A1")
    swept = replace(known[0], event=replace(known[0].event, run="sweep", covers="sweep"))  # it has no coefficients
    known.insert(1, swept)
    c = compose(second, known[-1], known, LaboratoryFile.model_validate(tomllib.loads(LABORATORY)))
    assert c.adjustment.earlier == "A1/1"
    assert c.adjustment.dwells == 2
    dwells = second.table("dwells").query("unit == 'A1' and kind == 'verification'")
    own = {(r.axis, r.effect, r.name): r.value for r in table.query("unit == 'A1'").itertuples()}
    errors = []
    for row in dwells.itertuples():  # a second implementation: K⁻¹(ã − b) with θ = T − 25
        theta = row.unit_C - 25.0
        b = [own[a, "bias", "K0"] + theta * own[a, "bias_temperature", "kT"] for a in "xyz"]
        k = np.array(
            [[own[a, "scale", "K1"] if a == o else own[a, "misalignment", f"K{a}{o}"] for o in "xyz"] for a in "xyz"]
        )
        k *= [[1.0 + theta * own[a, "scale_temperature", "aT"] / own[a, "scale", "K1"]] for a in "xyz"]
        force = np.linalg.solve(k, np.array([row.out_x, row.out_y, row.out_z]) - b)
        errors.append(1e6 * (np.linalg.norm(force) - np.linalg.norm([row.force_x, row.force_y, row.force_z])))
    np.testing.assert_allclose(c.adjustment.found_rms_ug, np.sqrt(np.mean(np.square(errors))), rtol=1e-6)
    assert '"Earlier certificate", "A1/1"' in json.dumps(page_content(c))
    assert found(dcc(c), "//dcc:status/text()") == ["beforeAdjustment", "afterAdjustment"]


@pytest.mark.slow
def test_a_long_serial_and_three_pages_of_coefficients_stay_on_the_paper(c: CertificateContent) -> None:
    serial = "S" + "0123456789ABCDEF" * 3 + "0123456789ABCDE"
    rows = tuple(
        Coefficient(effect="bias_temperature_quadratic", name=f"k{n}", axis="xyz"[n % 3],
                    value=1e5 / (n + 1), standard_error=1.2, unit="LSB")
        for n in range(150)
    )  # fmt: skip
    reference = ReferenceStandard(
        id="REF-1", what="local gravity", certificate="PTB 12345/26", laboratory="PTB", date="2026-01-02", due="2028-01-01",
        uncertainty="U = 2 ppm (k = 2)", sha256="0" * 64,
    )  # fmt: skip
    c = c.model_copy(
        update={"serial": serial, "number": f"{serial}/1", "coefficients": rows, "references": (reference,)}
    )
    with_heads = 0
    with pdfplumber.open(BytesIO(pdf(c, dcc(c)))) as pages:
        for page in pages.pages:
            assert max(word["x1"] for word in page.extract_words()) < page.width - 40.0  # the margin is 20 mm = 57 pt
            text = " ".join(page.extract_text().split())
            assert f"{serial}/1" in text
            if "bias temperature quadratic" in text:
                with_heads += "standard uncertainty of noise" in text
    assert with_heads >= 3


def test_the_pdf_claims_pdf_a_3b_and_holds_the_xml(c: CertificateContent, xml: bytes, paper: bytes) -> None:
    with pikepdf.open(BytesIO(paper)) as document, document.open_metadata() as meta:
        assert (meta["pdfaid:part"], meta["pdfaid:conformance"]) == ("3", "B")
        assert document.attachments["certificate.xml"].get_file().read_bytes() == xml
        assert document.attachments["certificate.xml"].relationship == pikepdf.Name.Alternative
        assert str(meta["xmp:CreateDate"]).startswith(date.fromisoformat(c.issued).isoformat())


def test_u_has_two_digits_and_the_value_ends_where_u_ends_in_certificate_and_report() -> None:
    for value, expanded, shown in (
        (823.7011, 18.142, ("824", "18")), (485.37, 549.6, ("490", "550")), (-786.87, 120.02, ("−790", "120")),
        (0.0123456, 0.000996, ("0.0123", "0.0010")), (5.0, 0.0996, ("5.00", "0.10")), (-0.0001, 0.5, ("0.00", "0.50")),
    ):  # fmt: skip
        assert with_uncertainty(value, expanded) == report_rounding(value, expanded) == shown


def test_a_laboratory_file_with_a_slip_is_refused_and_one_that_says_accredited_without_an_accreditation_in_it(
    tmp_path: Path,
) -> None:
    laboratory = tmp_path / "laboratory.toml"
    for old, new, why in (
        ('country = "DE"', 'country = "Germany"', r"laboratory\.country"),
        ("[customer]", "[costumer]", "unknown key 'costumer'"),
        ('email = "quality@example.org"', "", r"customer\.email"),
        ('role = "Head of calibration"', 'role = ""', r"signatory\.role"),
    ):
        laboratory.write_text(LABORATORY.replace(old, new), encoding="utf-8")
        with pytest.raises(RecipeInvalid, match=why):
            read_laboratory(laboratory)
    with pytest.raises(WrongUse, match=r"is not there, one with \[laboratory\]"):
        read_laboratory(tmp_path / "none.toml")
    laboratory.write_text(LABORATORY.replace("Example Sensor Works", "Accredited Sensor Works"), encoding="utf-8")
    with pytest.raises(RecipeInvalid, match=r"laboratory.name: speaks of accreditation, \[laboratory.accreditation\]"):
        read_laboratory(laboratory)


def test_traceability_is_claimed_for_what_names_a_standard_only() -> None:
    entries = {"gravity": True, "seat": False}
    own = {"frame": "fixture", "validity_months": 12, "customer_agreed": False, "quantities": (), "decisions": ()}
    standard = Reference(id="G-1", certificate="C-1", due=date(2027, 1, 1))
    text = traceability(StatedBudget(**own, references=(standard,), grade_source="certificates"), entries)
    assert "of the standards listed: gravity." in text
    assert text.endswith("by the sources in the budgets (certificates): seat.")
    assert "not claimed" in traceability(StatedBudget(**own, references=(), grade_source="data_sheet"), entries)


def test_the_unit_of_a_standard_is_read_by_symbol_or_name_and_printed_as_a_symbol() -> None:
    for written, symbol in (("µrad", "µrad"), ("\u03bcrad", "µrad"), ("urad", "µrad"), ("″", "″"), ("m/s²", "m/s²")):
        standard = Reference(id="G-1", certificate="C-1", due=date(2027, 1, 1), U=25.0, k=2.0, unit=written)
        assert standard_of(standard).uncertainty == f"U = 25 {symbol} (k = 2)"
    with pytest.raises(ValidationError):
        Reference(id="G-1", certificate="C-1", due=date(2027, 1, 1), U=25.0, k=2.0, unit="furlong")


def test_the_certificate_states_the_verdict_with_p_what_u_does_not_contain_and_no_probability_of_0(
    c: CertificateContent, xml: bytes
) -> None:
    assert re.fullmatch(r"ADEQUATE \(p (= 0\.\d+|= 1)\)", c.adequacy)
    assert c.left_out.startswith("Not stated, and not contained in the uncertainties U: ")
    assert "vibration" in c.left_out
    assert "seat" not in c.left_out
    declared, printed = xml.decode(), json.dumps(page_content(c), ensure_ascii=False)
    assert f"Model of the fit, by its residuals: {c.adequacy}" in declared
    assert c.left_out in declared
    assert c.adequacy in printed
    assert c.left_out in printed
    none = c.model_copy(update={"conformity": tuple(one.model_copy(update={"pfa": 0.0}) for one in c.conformity)})
    assert "probability of false acceptance < 1e-4" in html.unescape(dcc(none).decode())
    parts = {part.get("title"): part for part in page_content(c)["parts"]}
    (table,) = parts["Uncertainty budgets"]["tables"]  # all results in one, each followed by its contributions
    begins = [k for k, row in enumerate(table["rows"]) if not row[0].startswith("– ")]
    assert [table["rows"][k][0] for k in begins] == [one.quantity for one in c.budgets]
    for start, end in itertools.pairwise([*begins, len(table["rows"])]):
        assert sum(row[4] == "0.0 %" for row in table["rows"][start:end]) <= 1
    names = {row[0] for row in parts["Results"]["tables"][0]["rows"]}
    assert "error of the norm of gravity, verification (largest of the poses)" in names


def test_the_method_states_the_time_of_a_pose_where_it_is_known() -> None:
    dwells = pd.DataFrame({"kind": ["dwell"] * 3, "pose": range(3)})
    run = SimpleNamespace(table=lambda _: dwells)
    recipe = {"name": "import", "effects": ["bias"]}
    assert "3 poses at 1 temperature, 10.0 s per pose, recipe" in _static_method(run, recipe | {"dwell_s": 10.0}, "")
    assert "at 1 temperature, recipe" in _static_method(run, recipe, "")
