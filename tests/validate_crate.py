"""Runs another maker's RO-Crate validator without a network; for the interpreter that has it, not for ours.

The JSON-LD context of RO-Crate 1.1 is answered from here: the terms that our crates use, with the IRIs that RO-Crate gives them.
Anything else that is asked of the network is refused.
"""

import json
import sys
from types import MappingProxyType

import rdflib.plugins.shared.jsonld.context as jsonld
from rocrate_validator import models, services
from rocrate_validator.utils.http import HttpRequester

CONTEXT = "https://w3id.org/ro/crate/1.1/context"
SCHEMA = """
CreateAction CreativeWork Dataset IndividualProduct Organization Person SoftwareApplication
about affiliation agent author contentSize datePublished description encodingFormat endTime
hasPart instrument license mentions name object publisher result softwareVersion
"""
TERMS = {term: f"http://schema.org/{term}" for term in SCHEMA.split()} | {
    "File": "http://schema.org/MediaObject",
    "conformsTo": "http://purl.org/dc/terms/conformsTo",
}
DOCUMENT = {"@id": CONTEXT, "@context": TERMS}


class Answer:
    """What a server would have answered."""

    status_code = 200
    headers = MappingProxyType({"Content-Type": "application/ld+json"})
    content = json.dumps(DOCUMENT).encode()
    text = content.decode()

    @staticmethod
    def json() -> dict:
        return DOCUMENT


def get(self: object, url: str, **_: object) -> Answer:
    if url.rstrip("/") != CONTEXT:
        raise OSError(f"the network was asked for {url}")
    return Answer()


def source(url: object, *_: object, **__: object) -> object:
    if str(url) != CONTEXT:
        raise OSError(f"the network was asked for {url}")
    return DOCUMENT, None


HttpRequester.get = HttpRequester.head = get
jsonld.source_to_json = source
settings = services.ValidationSettings(
    rocrate_uri=sys.argv[1], profile_identifier="ro-crate-1.1", requirement_severity=models.Severity[sys.argv[2]]
)
result = services.validate(settings)
issues = [{"check": issue.check.identifier, "message": issue.message} for issue in result.get_issues()]
json.dump({"passed": result.passed(), "checks": len(result.executed_checks), "issues": issues}, sys.stdout, default=str)
