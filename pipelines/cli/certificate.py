"""``tumbleline certificate``: the certificates of units: issued for a period, listed, written as documents, revoked."""

from pipelines.cli.certificate_issue import issue
from pipelines.cli.certificate_list import list_certificates
from pipelines.cli.certificate_revoke import revoke
from pipelines.cli.certificate_write import write
from pipelines.cli.groups import group

PART = "Certificates, trace, audit"
ORDER = 410
SUMMARY = "Issue certificates for a period, list them, write them as documents, revoke them."
EXAMPLES = (
    "tumbleline certificate issue latest --until 12m",
    "tumbleline certificate write latest --laboratory laboratory.toml --output certificates",
)
EXAMPLES_OF = {
    "issue": ("tumbleline certificate issue latest --until 12m", "tumbleline certificate issue latest --units SN1"),
    "write": (
        "tumbleline certificate write latest --laboratory laboratory.toml --output certificates",
        "tumbleline certificate write SN1 --laboratory laboratory.toml --output certificates --sign-with key.pem",
    ),
    "list": ("tumbleline certificate list", "tumbleline certificate list --at 2026-06-30 --json"),
    "revoke": (
        "tumbleline certificate revoke SN1 --reason 'fell to the floor'",
        "tumbleline certificate revoke SN1 2 --reason 'reference out of date'",
    ),
}
"""Of the subcommands."""

app = group(SUMMARY, {"issue": issue, "list": list_certificates, "write": write, "revoke": revoke})
