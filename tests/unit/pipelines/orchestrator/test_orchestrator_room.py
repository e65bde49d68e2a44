"""Small modules of the orchestrator: addresses without credentials, policies of deployments, quick imports."""

import gc
from contextlib import suppress

import pytest
import yaml
from each import each
from hypothesis import given
from hypothesis import strategies as st
from root_process import ROOT

from pipelines.archive import Archive
from pipelines.orchestrator.archive_address import (
    archive_of,
    credentials_in,
    named,
    refuse_credentials,
    without_credentials,
)
from pipelines.orchestrator.policy import CHOICES, Policy, policy_of, policy_of_tags
from pipelines.orchestrator.server import quick_imports
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


@each(KEPT)
def test_an_address_without_credentials_stays_as_it_is(address: str) -> None:
    assert without_credentials(address) == address
    refuse_credentials(address)
    assert not credentials_in(f'{{"archive": "{address}"}}')


@each(TAKEN)
def test_credentials_are_taken_out_and_refused(row: tuple[str, str]) -> None:
    address, left = row
    assert without_credentials(address) == left
    assert credentials_in(f'{{"parameters": {{"archive": "{address}", "recipe": "x"}}}}')
    with pytest.raises(WrongUse, match="a parameter of a flow is an address with credentials") as told:
        archive_of(address)
    assert "secret" not in str(told.value).replace("Secret block", "")


def test_a_command_names_its_archive_without_credentials_and_flow_and_worker_find_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TUMBLELINE_ARCHIVE", "elsewhere")
    whole = "s3://AKIA:secret@factory/archive?region=us-east-1"
    with named(Archive(whole)) as shown:
        assert shown == "s3://factory/archive?region=us-east-1"
        assert archive_of(shown).address == whole
    assert archive_of(None).address.endswith("elsewhere")
    whole = "s3://AKIA:secret@factory/archive?region=us-east-1&scheme=http&endpoint_override=127.0.0.1:9"
    monkeypatch.setenv("TUMBLELINE_ARCHIVE", whole)
    assert archive_of(None).address == whole
    assert archive_of(without_credentials(whole)).address == whole
    other = "s3://factory/other?region=us-east-1"
    assert archive_of(other).address == other


@given(
    *(st.sampled_from(values) for values in CHOICES.values()),
    st.integers(1, 10080),
    st.lists(st.sampled_from(["production", "auto-scheduled", "busy=never", "latest_start_min=0", "missed"])),
)
def test_the_tags_of_a_deployment_carry_its_policy(
    busy: str, missed: str, crashed: str, minutes: int, others: list[str]
) -> None:
    policy = Policy(busy=busy, latest_start_min=minutes, missed=missed, crashed=crashed)
    assert policy_of_tags([*others, *policy.tags()]) == policy
    assert policy_of_tags([]) == Policy() == policy_of("a", None)


@each([
    ({"bussy": "wait"}, "policy has no key 'bussy'; did you mean busy?"),
    ({"busy": "queue"}, "policy.busy is 'queue', wait or skip is needed"),
    ({"missed": True}, "policy.missed is True, cancel or latest is needed"),
    ({"latest_start_min": 0}, "policy.latest_start_min is 0, a whole number from 1 to 10080 is needed"),
    ({"latest_start_min": "15"}, "policy.latest_start_min is '15'"),
    ({"latest_start_min": True}, "policy.latest_start_min is True"),
    ("wait", "policy is 'wait', a table of keys is needed"),
])  # fmt: skip
def test_a_policy_with_an_unknown_key_or_value_is_refused(row: tuple[object, str]) -> None:
    content, told = row
    with pytest.raises(WrongUse) as refused:
        policy_of("production-line", content)
    assert told in str(refused.value)
    assert str(refused.value).startswith("production-line: ")


def test_nothing_is_searched_while_it_is_imported_and_the_collector_is_as_before() -> None:
    before = gc.isenabled()
    try:
        gc.enable()
        with suppress(ModuleNotFoundError), quick_imports():
            assert not gc.isenabled()
            __import__("no_such_module_of_tumbleline")
        assert gc.isenabled()
        gc.disable()
        with quick_imports():
            pass
        assert not gc.isenabled()
    finally:
        gc.unfreeze()
        gc.enable() if before else gc.disable()


def test_the_deployments_of_the_product_state_a_policy() -> None:
    content = yaml.safe_load((ROOT / "deploy" / "prefect.yaml").read_text(encoding="utf-8"))
    policies = {one["name"]: policy_of(one["name"], one["policy"]) for one in content["deployments"]}
    assert policies["production-line"] == Policy(crashed="continue")
    assert policies["on-demand"] == Policy()
    assert policies["weekly-audit"].missed == "latest"
