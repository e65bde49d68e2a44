"""A certificate's XML against the archive: the document is generated again from the archive and compared completely."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import takewhile, zip_longest
from typing import Any

from pydantic import ValidationError

from pipelines.archive import Archive, Run
from pipelines.certificates import Calibration, Ledger
from pipelines.certificates.days import today
from pipelines.certificates.document.compose import compose
from pipelines.certificates.document.content import CertificateContent
from pipelines.certificates.document.dcc import dcc, statements_of
from pipelines.certificates.document.laboratory import LaboratoryFile
from pipelines.certificates.document.signature_check import CertificateFacts, canonical, first, parsed, statements
from schemas.errors import ArchiveUnusable, TumblelineError

SHOWN = 3  # differences that are named
LONGEST = 90  # of a text that is shown
SPACE = "space between elements"
NONE = ("", "", "")


@dataclass(frozen=True)
class Compared:
    """The comparison of a certificate with the archive.

    known : whether the ledger has its number; ended : reason why it is no longer valid, empty if it is
    until : end of its validity and what follows, if that is known already
    different : sentences about the differences; count : number of texts and numbers that were compared
    reason : reason why the document could not be generated again, empty if it was
    unproven : statements that the archive cannot prove, in one line; empty if the laboratory's file was given
    """

    known: bool
    ended: str = ""
    until: str = ""
    different: tuple[str, ...] = ()
    reason: str = ""
    count: int = 0
    unproven: str = ""


def compare(root: Any, facts: CertificateFacts, archive: Archive, who: LaboratoryFile | None = None) -> Compared:
    """The comparison of a certificate with the archive.

    Parameters
    ----------
    root : the root element of its XML; facts : what it states
    who : the laboratory's file; if None, its texts are taken from the document and reported as not proven
    """
    known = Ledger(archive).calibrations(facts.serial) if facts.serial else []
    calibration = next((entry for entry in known if entry.certificate == facts.number), None)
    if calibration is None:
        return Compared(known=False)
    try:
        made = _generated_again(root, Run(archive, calibration.run), calibration, known, who)
    except ValidationError as problem:
        text = f"{'.'.join(map(str, problem.errors()[0]['loc']))}: {problem.errors()[0]['msg']}".removeprefix(": ")
        return Compared(True, *_ended(calibration), (f"what the file says of the laboratory is not allowed: {text}",))
    except ArchiveUnusable as problem:
        return Compared(True, *_ended(calibration), (*_other_entry(facts, calibration), str(problem)))
    except TumblelineError as problem:
        return Compared(True, *_ended(calibration), _other_entry(facts, calibration), reason=str(problem))
    # comments and instructions before the root element count as well
    found, expected = root.getroottree(), [parsed(dcc(content)).getroottree() for content in made]
    if any(canonical(found) == canonical(document) for document in expected):
        unproven = "" if who is not None else said_by(made[0].who)
        return Compared(True, *_ended(calibration), count=len(list(_nodes(root))), unproven=unproven)
    return Compared(True, *_ended(calibration), tuple(_different(root, expected[0].getroot())))


def _generated_again(
    root: Any, run: Run, calibration: Calibration, known: list[Calibration], who: LaboratoryFile | None
) -> list[CertificateContent]:
    """The document as issued, and, if the certificate was replaced since, the document that names its successor."""
    first = compose(run, replace(calibration, ended_by=None), known, who or NOBODY)
    if who is None:
        laboratory = laboratory_in(root, first)
        method = f"{laboratory.method.procedure}. {first.method}" if laboratory.method.procedure else first.method
        first = first.model_copy(update={"who": laboratory, "method": method})
    if calibration.ended_by is None or calibration.ended_by.action == "revoke":
        return [first]
    named = first.amendment.model_copy(update={"replaced_by": calibration.ended_by.certificate})
    return [first, first.model_copy(update={"amendment": named})]


def _other_entry(facts: CertificateFacts, calibration: Calibration) -> tuple[str, ...]:
    """Differences of a document from its entry in the ledger, for a document that cannot be generated again."""
    entries = (
        ("run", facts.run, calibration.run),
        ("SHA-256 of the certified table", facts.coefficients, calibration.event.coefficients),
        ("date of issue", facts.issued, calibration.event.when[:10]),
    )
    return tuple(
        f"{what}: the file says {found or 'nothing'}, the ledger {needed}"
        for what, found, needed in entries
        if found != needed
    )


def _different(found: Any, expected: Any) -> list[str]:
    """The first differences of two documents, and the number of the others."""
    pairs = [(a, b) for a, b in zip_longest(_nodes(found), _nodes(expected)) if (a or NONE)[:2] != (b or NONE)[:2]]
    if not pairs:
        return ["the file differs from the document of the archive in what stands around its root element"]
    pairs = [pair for pair in pairs if SPACE not in {item[0] for item in pair if item}] or pairs
    lines = [_line(a or NONE, b or NONE) for a, b in pairs[:SHOWN]]
    return [*lines, f"and {len(pairs) - SHOWN} other places"] if len(pairs) > SHOWN else lines


def _line(found: tuple[str, str, str], expected: tuple[str, str, str]) -> str:
    if found[0] == expected[0]:
        equal = takewhile(lambda pair: pair[0] == pair[1], zip(found[1], expected[1], strict=False))
        common = len(list(equal)) if len(found[1]) > LONGEST else 0
        return f"{expected[2]}: the file says {_short(found[1], common)}, the archive {_short(expected[1], common)}"
    return (
        f"{found[2] or 'end of the document'}: the file says {_short(found[1])}, the archive has "
        f"{expected[2] or 'nothing'} {_short(expected[1])} in its place"
    )


def _short(text: str, common: int = 0) -> str:
    """An excerpt of a text, starting shortly before its first difference."""
    excerpt = " ".join(f"{'…' if common > 20 else ''}{text[max(0, common - 20) :]}".split())
    return f"'{excerpt[:LONGEST]}{'…' if len(excerpt) > LONGEST else ''}'" if excerpt else "nothing"


def _nodes(root: Any) -> Iterator[tuple[str, str, str]]:
    """Every element, attribute and text of a document in order: tag, text, and a label for messages."""
    for element in root.iter():
        if not isinstance(element.tag, str):
            yield "comment or instruction", str(element.text), "comment or instruction"
        else:
            label = _named(element)
            yield element.tag, element.text or "", label
            for name, value in sorted(element.attrib.items()):
                yield f"{element.tag} {name}", value, f"{label}, attribute {name}"
        yield SPACE, element.tail or "", SPACE


def _named(element: Any) -> str:
    """The path of an element below the nearest element that has a name, such as a result."""
    path: list[str] = []
    while element is not None:
        head = next((child.findtext("{*}content") for child in element.findall("{*}name")), None)
        if head and path:
            return f"{head}: {' '.join(reversed(path))}"
        path.append(element.tag.rpartition("}")[2])
        element = element.getparent()
    return " ".join(reversed(path[:3]))


def _ended(calibration: Calibration) -> tuple[str, str]:
    """The reason why a calibration is no longer valid, and the end of one that is still valid; each may be empty."""
    by = calibration.ended_by
    if by is None:
        return "", ""
    reason = f": {by.reason}" if by.reason else ""
    if by.action == "revoke":
        return f"revoked on {by.when[:10]} by {by.who}, not valid from {calibration.until} on{reason}", ""
    amended = "amended and replaced" if by.run == calibration.run else "superseded"
    text = f"{amended} by certificate {by.certificate} on {by.when[:10]}, not valid from {calibration.until} on{reason}"
    return ("", text) if today() < calibration.until else (text, "")


CORE, ITEM = "dcc:coreData", "dcc:items/dcc:item"
LABORATORY, PERSON = "dcc:calibrationLaboratory", "dcc:respPersons/dcc:respPerson"
NAME = "dcc:name/dcc:content"
CONTACT = {"name": NAME, "email": "dcc:eMail", "address": "dcc:location/dcc:further/dcc:content"}
STATED = {
    "laboratory": {
        **{key: f"{LABORATORY}/dcc:contact/{path}" for key, path in CONTACT.items()},
        "country": f"{CORE}/dcc:countryCodeISO3166_1",
        "place": f"{CORE}/dcc:performanceLocation",
    },
    "customer": {
        **{key: f"dcc:customer/{path}" for key, path in CONTACT.items()},
        "order": f"{CORE}/dcc:identifications/dcc:identification[dcc:name/dcc:content='order']/dcc:value",
    },
    "signatory": {"name": f"{PERSON}/dcc:person/{NAME}", "role": f"{PERSON}/dcc:role"},
    "item": {
        "manufacturer": f"{ITEM}/dcc:manufacturer/{NAME}",
        "description": f"{ITEM}/{NAME}",
        "model": f"{ITEM}/dcc:model",
        "received": f"{CORE}/dcc:receiptDate",
        "condition": f"{ITEM}/dcc:description/dcc:content",
    },
}
"""Paths in the administrative data of a document, by the keys of the laboratory's file."""
ACCREDITED, DEVIATIONS = "Accreditation: ", "Deviations from the method: "

NOBODY = LaboratoryFile.model_validate(
    {
        "laboratory": {"name": "-", "address": "-", "country": "DE", "email": "-@-"},
        "customer": {"name": "-", "address": "-", "email": "-@-"},
        "signatory": {"name": "-", "role": "-"},
        "item": {"manufacturer": "-"},
    }
)
"""Placeholder for the laboratory's file, to generate a document from the archive alone."""


def laboratory_in(root: Any, archived: CertificateContent) -> LaboratoryFile:
    """The laboratory's file as stated by a document, without texts that come from the archive.

    If the document generated with it from the archive equals this one, only these texts can have been changed.

    Parameters
    ----------
    archived : content of the certificate from the archive, made with :data:`NOBODY`

    Raises
    ------
    pydantic.ValidationError
        A text is not allowed in a laboratory's file, such as a claim of accreditation without its body and number.
    """

    def administrative(path: str) -> str:
        return first(root, f"/*/dcc:administrativeData/{path}/text()")

    stated: dict[str, dict[str, Any]] = {
        table: {key: administrative(path) for key, path in paths.items()} for table, paths in STATED.items()
    }
    stated["item"]["received"] = stated["item"]["received"] or None
    known = set(statements_of(archived))
    other = [text for text in statements(root) if text not in known]
    claim, deviations = (
        next((text for text in other if text.startswith(head)), "").removeprefix(head)
        for head in (ACCREDITED, DEVIATIONS)
    )
    number = administrative(f"{LABORATORY}/dcc:calibrationLaboratoryCode")
    if claim or number:
        stated["laboratory"]["accreditation"] = {"body": claim.removesuffix(f", {number}"), "number": number}
    used = "/*/dcc:measurementResults/dcc:measurementResult/dcc:usedMethods/dcc:usedMethod"
    method = first(root, f"{used}/dcc:description/dcc:content/text()")
    stated["method"] = {
        "procedure": method.removesuffix(archived.method).removesuffix(". "),
        "deviations": deviations,
        "remarks": next((text for text in other if not text.startswith((ACCREDITED, DEVIATIONS))), ""),
    }
    return LaboratoryFile.model_validate(stated)


def said_by(who: LaboratoryFile) -> str:
    """All statements of a laboratory's file, table by table, in one line."""
    tables = who.model_dump(mode="json", exclude_none=True)
    return "; ".join(f"{name}: {', '.join(_values(table))}" for name, table in tables.items() if _values(table))


def _values(table: dict[str, Any]) -> list[str]:
    values = [_values(value) if isinstance(value, dict) else [str(value)] for value in table.values() if value]
    return [text for texts in values for text in texts]
