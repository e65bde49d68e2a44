"""The schemas of the Digital Calibration Certificate that are shipped, and validation against them without a network."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

from schemas.errors import TumblelineError
from schemas.library import library

EXTRA, WHERE = "pdf", "certificate"
SI_ADDRESS = "https://ptb.de/si/v2.0.0/SI_Format.xsd"


class DocumentInvalid(TumblelineError):
    """A certificate's XML that its schema does not allow: an error of this program, never of its user."""


@cache
def schema() -> Any:
    """The XML schema of DCC 3.0.0 with D-SI 2.0.0, from the files beside this module."""
    etree = library("lxml.etree", EXTRA, WHERE)
    folder = files("pipelines.certificates.document") / "schemas"

    class Local(etree.Resolver):
        """Gives the copy that is shipped for the address in the import, and nothing for any other."""

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
