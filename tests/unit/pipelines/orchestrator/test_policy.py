"""The policy of a deployment: what prefect.yaml may state, and that its tags carry it."""

import pytest
import yaml
from each import each
from hypothesis import given
from hypothesis import strategies as st
from root_process import ROOT

from pipelines.orchestrator.policy import CHOICES, Policy, policy_of, policy_of_tags
from schemas.errors import WrongUse

DEPLOY = ROOT / "deploy"


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


def test_the_deployments_of_the_product_state_a_policy() -> None:
    content = yaml.safe_load((DEPLOY / "prefect.yaml").read_text(encoding="utf-8"))
    policies = {one["name"]: policy_of(one["name"], one["policy"]) for one in content["deployments"]}
    assert policies["production-line"] == Policy(crashed="continue")
    assert policies["on-demand"] == Policy()
    assert policies["weekly-audit"].missed == "latest"
