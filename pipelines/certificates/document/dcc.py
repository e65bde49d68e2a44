"""The certificate as XML, DCC 3.0.0 of the PTB (Digital Calibration Certificate) with D-SI 2.0.0, and its validation offline."""

from collections.abc import Iterable, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

from pipelines.certificates.document.content import CertificateContent, Conformity, Response, Result, letters_of
from pipelines.certificates.document.numbers import least_of, si_unit
from schemas.errors import TumblelineError
from schemas.library import library
from schemas.units import AXES

EXTRA, WHERE = "pdf", "certificate"
SI_ADDRESS = "https://ptb.de/si/v2.0.0/SI_Format.xsd"


class DocumentInvalid(TumblelineError):
    """The generated XML is not valid against its schema: an error of this program, never of its user."""


@cache
def schema() -> Any:
    """The XML schema of DCC 3.0.0 with D-SI 2.0.0, from the files beside this module."""
    etree = library("lxml.etree", EXTRA, WHERE)
    folder = files("pipelines.certificates.document") / "schemas"

    class Local(etree.Resolver):
        """Returns the shipped copy for the address of the import, and refuses any other address."""

        def resolve(self, system_url: str, public_id: str, context: Any) -> Any:
            if system_url != SI_ADDRESS:
                raise OSError(f"certificate: schema {system_url} is not shipped, {SI_ADDRESS} is")
            return self.resolve_string((folder / "SI_Format.xsd").read_bytes(), context, base_url=SI_ADDRESS)

    parser = etree.XMLParser(no_network=True, resolve_entities=False)
    parser.resolvers.add(Local())
    return etree.XMLSchema(etree.fromstring((folder / "dcc.xsd").read_bytes(), parser))


def validate(document: bytes) -> None:
    """Refuse a certificate's XML that is not valid against DCC 3.0.0.

    Raises
    ------
    DocumentInvalid
        With the first place that is wrong.
    """
    etree = library("lxml.etree", EXTRA, WHERE)
    rules = schema()
    if not rules.validate(etree.fromstring(document, etree.XMLParser(no_network=True, resolve_entities=False))):
        first = rules.error_log[0]
        raise DocumentInvalid(
            f"certificate: the XML is not valid against DCC 3.0.0 (line {first.line}: {first.message}); report this with the run"
        )


DCC, SI, VERSION = "https://ptb.de/dcc", "https://ptb.de/si", "3.0.0"
COVERAGE = 0.9545
OUTCOMES = {
    "pass": "pass",
    "fail": "fail",
    "conditional pass": "conditionalPass",
    "conditional fail": "conditionalFail",
}


def dcc(content: CertificateContent) -> bytes:
    """The XML of a certificate, valid against the schema; the same bytes for the same content.

    Raises
    ------
    DocumentInvalid
        The schema does not allow it.
    WrongUse
        lxml is not installed.
    """
    etree = library("lxml.etree", EXTRA, WHERE)
    writer = _Writer(etree)
    root = etree.Element(f"{{{DCC}}}digitalCalibrationCertificate", nsmap={"dcc": DCC, "si": SI}, schemaVersion=VERSION)
    _administrative(writer, writer.add(root, "administrativeData"), content)
    _measured(writer, writer.add(writer.add(root, "measurementResults"), "measurementResult"), content)
    etree.indent(root)
    data = etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n"
    validate(data)
    return data


class _Writer:
    """Elements of the two namespaces."""

    def __init__(self, etree: Any) -> None:
        self._etree = etree

    def add(self, parent: Any, name: str, text: str | None = None, space: str = DCC, **attributes: str) -> Any:
        """A child with text."""
        child = self._etree.SubElement(parent, f"{{{space}}}{name}", **attributes)
        child.text = text
        return child

    def text(self, parent: Any, name: str, text: str) -> Any:
        """A child whose text is English content."""
        child = self.add(parent, name)
        self.add(child, "content", text, lang="en")
        return child

    def reals(self, parent: Any, name: str, unit: str, values: Sequence[tuple[float, float | None, float]]) -> None:
        """A quantity that is a list of values with their own U and k; U is None of values that have none."""
        quantity = self.add(parent, "quantity")
        known = si_unit(unit)
        self.text(quantity, "name", name if known is not None else f"{name} in {unit}")
        factor, text = (1.0, r"\one") if known is None else (known.factor, known.text)
        box = self.add(self.add(quantity, "list", space=SI), "realList", space=SI)
        self.add(box, "listUnit", text, space=SI)
        for value, expanded, k in values:
            real = self.add(box, "real", space=SI)
            self.add(real, "value", repr(value * factor), space=SI)
            if expanded is not None:
                self._expanded(real, expanded * factor, k)

    def _expanded(self, parent: Any, expanded: float, k: float | None) -> None:
        element = self.add(parent, "expandedUnc", space=SI)
        self.add(element, "uncertainty", repr(expanded), space=SI)
        self.add(element, "coverageFactor", repr(k), space=SI)
        self.add(element, "coverageProbability", repr(COVERAGE), space=SI)

    def real(self, parent: Any, value: float, unit: str, label: str = "", result: Result | None = None) -> None:
        """A quantity in SI units with its expanded uncertainty; where its unit has none, a number with the unit in its label."""
        known = si_unit(unit)
        factor, text = (1.0, r"\one") if known is None else (known.factor, known.text)
        real = self.add(parent, "real", space=SI)
        if label or known is None:
            self.add(real, "label", label if known is not None else f"{label} in {unit}".strip(), space=SI)
        self.add(real, "value", repr(float(value) * factor), space=SI)
        self.add(real, "unit", text, space=SI)
        if result is not None and result.value is not None and result.expanded is not None:
            self._expanded(real, result.expanded * factor, result.k)


def _administrative(w: _Writer, parent: Any, c: CertificateContent) -> None:
    software = w.add(w.add(parent, "dccSoftware"), "software")
    name, _, release = c.software.partition(" ")
    w.text(software, "name", name)
    w.add(software, "release", release)
    core = w.add(parent, "coreData")
    w.add(core, "countryCodeISO3166_1", c.who.laboratory.country)
    w.add(core, "usedLangCodeISO639_1", "en")
    w.add(core, "mandatoryLangCodeISO639_1", "en")
    w.add(core, "uniqueIdentifier", c.number)
    _identifications(w, core, [("calibrationLaboratory", c.run, "run"), ("customer", c.who.customer.order, "order")])
    if c.who.item.received is not None:
        w.add(core, "receiptDate", c.who.item.received.isoformat())
    w.add(core, "beginPerformanceDate", c.measured_from)
    w.add(core, "endPerformanceDate", c.measured_to)
    w.add(core, "performanceLocation", c.who.laboratory.place)
    item = w.add(w.add(parent, "items"), "item")
    w.text(item, "name", c.who.item.description)
    if c.who.item.condition:
        w.text(item, "description", c.who.item.condition)
    w.text(w.add(item, "manufacturer"), "name", c.who.item.manufacturer)
    w.add(item, "model", c.who.item.model or c.device)
    _identifications(w, item, [("manufacturer", c.serial, "serial number")])
    laboratory = c.who.laboratory
    element = w.add(parent, "calibrationLaboratory")
    if laboratory.accreditation is not None:
        w.add(element, "calibrationLaboratoryCode", laboratory.accreditation.number)
    _contact(w, element, "contact", laboratory.name, laboratory.email, laboratory.address)
    person = w.add(w.add(parent, "respPersons"), "respPerson")
    w.text(w.add(person, "person"), "name", c.who.signatory.name)
    w.add(person, "role", c.who.signatory.role)
    w.add(person, "mainSigner", "true")
    _contact(w, parent, "customer", c.who.customer.name, c.who.customer.email, c.who.customer.address)
    statements = w.add(parent, "statements")
    for text in statements_of(c):
        w.text(w.add(statements, "statement"), "declaration", text)


def statements_of(c: CertificateContent) -> list[str]:
    """The declarations of a certificate beside its results."""
    parts = [
        f"Date of issue: {c.issued}",
        "SIMULATED: the station that these results come from is a simulation; no device was measured"
        if c.simulated
        else "",
        c.declaration,
        c.uncertainty_note,
        c.left_out,
        c.traceability,
        f"Model of the fit, by its residuals: {c.adequacy}" if c.adequacy else "",
        f"Frame of the results: {c.frame}",
        f"Accreditation: {a.body}, {a.number}" if (a := c.who.laboratory.accreditation) is not None else "",
        f"Replaces certificate {', '.join(c.amendment.replaces)}; changed: {c.amendment.reason or 'reason not stated'}"
        if c.amendment.replaces
        else "",
        f"Replaced by certificate {c.amendment.replaced_by}" if c.amendment.replaced_by else "",
        f"Deviations from the method: {c.who.method.deviations}" if c.who.method.deviations else "",
        c.who.method.remarks,
        c.interval,
        f"SHA-256 of the table of {c.certified_table.replace('_', ' ')}: {c.certified_sha256}",
    ]
    return [part for part in parts if part]


def _identifications(w: _Writer, parent: Any, entries: Iterable[tuple[str, str, str]]) -> None:
    box = w.add(parent, "identifications")
    for issuer, value, name in entries:
        if value:
            identification = w.add(box, "identification")
            w.add(identification, "issuer", issuer)
            w.add(identification, "value", value)
            w.text(identification, "name", name)


def _contact(w: _Writer, parent: Any, tag: str, name: str, email: str, address: str) -> None:
    contact = w.add(parent, tag)
    w.text(contact, "name", name)
    w.add(contact, "eMail", email)
    w.text(w.add(contact, "location"), "further", address)


def _measured(w: _Writer, parent: Any, c: CertificateContent) -> None:
    w.text(parent, "name", f"Calibration of {c.who.item.description} {c.serial}")
    method = w.add(w.add(parent, "usedMethods"), "usedMethod")
    w.text(method, "name", "Static multi-position calibration in gravity" if c.coefficients else "Comparison")
    w.text(method, "description", c.method)
    for norm in c.norms:
        w.add(method, "norm", norm)
    if c.references:
        box = w.add(parent, "measuringEquipments")
        for reference in c.references:
            _reference(w, box, reference)
    if c.conditions or c.adjustment.found_rms_ug is not None:
        _conditions(w, w.add(parent, "influenceConditions"), c)
    _results(w, w.add(parent, "results"), c)
    meta = w.add(parent, "measurementMetaData")
    for decision in c.conformity:
        _conformity(w, w.add(meta, "metaData"), decision, c)
    if not c.conformity:
        w.text(w.add(meta, "metaData"), "declaration", "no statement of conformity is made")


def _results(w: _Writer, results: Any, c: CertificateContent) -> None:
    for result in c.results:
        element = w.add(results, "result")
        w.text(element, "name", f"{result.quantity}, {result.axis}")
        if result.value is None:
            w.text(element, "description", "expanded uncertainty")
        data = w.add(w.add(element, "data"), "quantity")
        shown = result.expanded if result.value is None else result.value
        w.real(data, shown or 0.0, result.unit, result=result)
    for response in c.responses:
        _response(w, results, response)
    if c.coefficients:
        element = w.add(results, "result")
        w.text(element, "name", "coefficients of the fit, as archived; their uncertainty is in the results above")
        box = w.add(w.add(element, "data"), "list")
        for coefficient in c.coefficients:
            quantity = w.add(box, "quantity")
            w.text(quantity, "name", f"{coefficient.effect} {coefficient.name} {coefficient.axis}")
            w.real(quantity, coefficient.value, coefficient.unit)


def _response(w: _Writer, parent: Any, response: Response) -> None:
    """Sensitivity over frequency as lists in the order of the points, and the curve through it."""
    element = w.add(parent, "result")
    w.text(element, "name", f"sensitivity over frequency, {response.title}")
    box = w.add(w.add(element, "data"), "list")
    points = response.points
    for name, unit, values in (
        ("frequency", "Hz", [(p.frequency_hz, None, 0.0) for p in points]),
        ("amplitude of the motion", "g", [(p.level_g, None, 0.0) for p in points]),
        ("temperature of the item", "°C", [(p.temperature_C, None, 0.0) for p in points]),
        (
            "magnitude of the sensitivity",
            response.unit,
            [(p.magnitude, p.magnitude_expanded, p.magnitude_k) for p in points],
        ),
        ("phase of the sensitivity", "°", [(p.phase_deg, p.phase_expanded, p.phase_k) for p in points]),
    ):
        w.reals(box, name, unit, values)
    if (curve := response.curve) is None:
        return
    element = w.add(parent, "result")
    w.text(element, "name", f"curve through the sensitivity over frequency, {response.title}")
    text = f"{curve.model}, {curve.verdict}, p {curve.p_value:.3g}, from {curve.low_hz:g} to {curve.high_hz:g} Hz"
    w.text(element, "description", text)
    box = w.add(w.add(element, "data"), "list")
    for p in curve.parameters:
        w.reals(box, p.name.replace("_", " "), p.unit, [(p.value, p.expanded, p.k)])
    units = [si_unit(p.unit) for p in curve.parameters]
    factors = [1.0 if unit is None else unit.factor for unit in units]
    pairs = [(k, j) for k in range(len(factors)) for j in range(k + 1)]
    covariance = [
        (value * factors[k] * factors[j], None, 0.0) for value, (k, j) in zip(curve.covariance, pairs, strict=True)
    ]
    w.reals(box, "covariance of the parameters in the units above, lower triangle row by row", "1", covariance)


def _reference(w: _Writer, parent: Any, reference: Any) -> None:
    box = w.add(parent, "measuringEquipment")
    w.text(box, "name", reference.what or reference.id)
    w.text(box, "description", f"due {reference.due}; {reference.uncertainty or 'uncertainty not stated'}")
    certificate = w.add(box, "certificate")
    laboratory = reference.laboratory or "laboratory not stated"
    w.text(certificate, "referral", f"{laboratory}, {reference.date or 'date not stated'}")
    w.add(certificate, "referralID", reference.certificate)
    w.add(certificate, "procedure", "SHA-256" if reference.sha256 else "none: no hash is stated")
    w.add(certificate, "value", reference.sha256)
    _identifications(w, box, [("calibrationLaboratory", reference.id, "reference standard")])


def _conditions(w: _Writer, parent: Any, c: CertificateContent) -> None:
    for condition in c.conditions:
        box = w.add(parent, "influenceCondition")
        w.text(box, "name", condition.name)
        data = w.add(box, "data")
        for label, value in (("lowest", condition.low), ("highest", condition.high)):
            w.real(w.add(data, "quantity"), value, condition.unit, label)
    a = c.adjustment
    for status, rms, text in (
        ("beforeAdjustment", a.found_rms_ug, f"with the coefficients of certificate {a.earlier}"),
        ("afterAdjustment", a.left_rms_ug, "with the coefficients of this certificate"),
    ):
        if rms is not None:
            box = w.add(parent, "influenceCondition")
            what = "corrected output" if len(letters_of(c.coefficients)) < len(AXES) else "norm of gravity"
            w.text(box, "name", f"RMS error of the {what} {text}")
            w.add(box, "status", status)
            w.real(w.add(w.add(box, "data"), "quantity"), rms, "µg")


def _conformity(w: _Writer, parent: Any, conformity: Conformity, c: CertificateContent) -> None:
    w.add(parent, "norm", " ".join(c.decision_rule.split()))
    limit = f"limit {conformity.limit:.10g} {conformity.unit} of '{c.limits}'"
    text = f"{conformity.figure}: {limit}, specific probability of false acceptance {least_of(conformity.pfa)}"
    w.text(parent, "declaration", f"{text}. {c.grade_statement}".removesuffix(". "))
    w.add(parent, "conformity", OUTCOMES.get(conformity.outcome, "noPass"))
