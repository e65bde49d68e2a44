"""The certificate for people: PDF/A-3b with the XML attached, typeset by typst; the same bytes for the same content."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from importlib.resources import files
from typing import Any

from pipelines.certificates.document.content import CertificateContent
from pipelines.certificates.document.pages import page_content
from pipelines.certificates.document.schema_files import EXTRA, WHERE
from schemas.library import library


def pdf(content: CertificateContent, xml: bytes, address: str = "") -> bytes:
    """The PDF of a certificate.

    The document claims PDF/A-3b; typst refuses to write what breaks the rules that it knows. That claim has not been checked with
    an independent validator (veraPDF).

    Parameters
    ----------
    xml : of the same content, attached as its alternative form.
    address : printed as a QR code; none where empty.

    Raises
    ------
    WrongUse
        typst, or segno for a QR code, is not installed.
    """
    typst = library("typst", EXTRA, WHERE)
    inputs: dict[str, Any] = page_content(content) | {"qr": _qr(address) if address else ""}
    compiler = typst.Compiler(
        (files("pipelines.certificates.document") / "certificate.typ").read_bytes(),
        font_paths=typst.Fonts(include_system_fonts=False, include_embedded_fonts=True),
        sys_inputs={"content": json.dumps(inputs), "xml": xml.decode("utf-8")},
    )
    issued = datetime.fromisoformat(content.issued).replace(tzinfo=UTC)
    return compiler.compile(format="pdf", pdf_standards="a-3b", timestamp=issued)


def _qr(address: str) -> str:
    segno = library("segno", EXTRA, WHERE)
    return segno.make(address, error="m", micro=False).svg_inline(border=1)
