"""Credentials of an archive's address: found in every place where they stand, and never a parameter of a flow."""

import pytest

from pipelines.archive import Archive
from pipelines.orchestrator.archive_address import archive_of, named
from pipelines.orchestrator.credentials import credentials_in, refuse_credentials, without_credentials
from schemas.errors import WrongUse

KEPT = [
    "archive", "/srv/archive", "file:///srv/archive", "s3://factory/archive", "gs://anonymous@factory/archive",
    "s3://factory/archive?endpoint_override=127.0.0.1:9000&scheme=http&region=us-east-1",
    "s3://factory/a@b", "abfss://factory.blob.core.windows.net/c?credential_kind=default", "hdfs://namenode:8020/archive",
]  # fmt: skip
TAKEN = [
    ("s3://AKIA:secret@factory/archive", "s3://factory/archive"),
    ("s3://AKIA@factory/archive", "s3://factory/archive"),
    ("s3://AKIA:se@cret@factory/archive?region=eu", "s3://factory/archive?region=eu"),
    ("abfss://:secret@account.blob.core.windows.net/c", "abfss://account.blob.core.windows.net/c"),
    ("abfss://c/a?client_secret=x&tenant_id=t", "abfss://c/a?tenant_id=t"),
    ("abfss://c/a?sas_token=x", "abfss://c/a"),
    ("s3://b/a?access_key=x&secret_key=y&scheme=http", "s3://b/a?scheme=http"),
    ("s3://b/a?X-Amz-Security-Token=x&X-Amz-Signature=y", "s3://b/a"),
]


@pytest.mark.parametrize("address", KEPT)
def test_an_address_without_credentials_stays_as_it_is(address: str) -> None:
    assert without_credentials(address) == address
    refuse_credentials(address)
    assert not credentials_in(f'{{"archive": "{address}"}}')


@pytest.mark.parametrize(("address", "left"), TAKEN)
def test_credentials_are_taken_out_and_refused(address: str, left: str) -> None:
    assert without_credentials(address) == left
    assert credentials_in(f'{{"parameters": {{"archive": "{address}", "recipe": "x"}}}}')
    with pytest.raises(WrongUse, match="a parameter of a flow is an address with credentials") as told:
        archive_of(address)
    assert "secret" not in str(told.value).replace("Secret block", "")


def test_the_worker_takes_the_credentials_from_its_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = "s3://AKIA:secret@factory/archive?region=us-east-1&scheme=http&endpoint_override=127.0.0.1:9"
    monkeypatch.setenv("TUMBLELINE_ARCHIVE", whole)
    assert archive_of(None).address == whole
    assert archive_of(without_credentials(whole)).address == whole
    other = "s3://factory/other?region=us-east-1"
    assert archive_of(other).address == other


def test_a_command_names_its_archive_without_credentials_and_its_flow_finds_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TUMBLELINE_ARCHIVE", "elsewhere")
    whole = "s3://AKIA:secret@factory/archive?region=us-east-1"
    with named(Archive(whole)) as shown:
        assert shown == "s3://factory/archive?region=us-east-1"
        assert archive_of(shown).address == whole
    assert archive_of(None).address.endswith("elsewhere")
