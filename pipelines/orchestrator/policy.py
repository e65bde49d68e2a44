"""Policy of a deployment: what happens to its runs while the station is busy, after downtime, and after a crash.

``prefect.yaml`` states it under ``policy``; the deployment carries it as tags, which its flow runs inherit::

    policy:
      busy: wait             # or skip: a scheduled run is cancelled while another run has the station
      latest_start_min: 15   # a scheduled run that could not start until then is missed
      missed: cancel         # or latest: of the missed runs of a deployment the newest is run once
      crashed: close         # or continue: a run whose process died continues from its checkpoint
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, fields
from datetime import timedelta
from typing import Any, Literal, cast, get_args

from schemas.errors import WrongUse, did_you_mean

Busy = Literal["wait", "skip"]
Missed = Literal["cancel", "latest"]
Crashed = Literal["close", "continue"]

CHOICES: dict[str, tuple[str, ...]] = {"busy": get_args(Busy), "missed": get_args(Missed), "crashed": get_args(Crashed)}
LONGEST_MIN = 7 * 24 * 60
TAG = re.compile(r"(busy|latest_start_min|missed|crashed)=(\w+)")


@dataclass(frozen=True)
class Policy:
    """Policy of a deployment; the defaults are for a station without an operator."""

    busy: Busy = "wait"
    latest_start_min: int = 15
    missed: Missed = "cancel"
    crashed: Crashed = "close"

    @property
    def latest_start(self) -> timedelta:
        """Longest time between the scheduled and the real start of a run."""
        return timedelta(minutes=self.latest_start_min)

    def tags(self) -> list[str]:
        """The policy as tags of a deployment."""
        return [f"{field.name}={getattr(self, field.name)}" for field in fields(self)]


def policy_of(deployment: str, content: object) -> Policy:
    """The policy that a ``prefect.yaml`` states for a deployment.

    Raises WrongUse: an unknown key or value.
    """
    if content is None:
        return Policy()
    if not isinstance(content, dict):
        raise WrongUse(f"{deployment}: policy is {content!r}, a table of keys is needed; see deploy/prefect.yaml")
    stated = cast("dict[str, Any]", content)
    known = [field.name for field in fields(Policy)]
    for key, value in stated.items():
        if key not in known:
            raise WrongUse(f"{deployment}: policy has no key '{key}'; {did_you_mean(key, known)}")
        if key in CHOICES and value not in CHOICES[key]:
            raise WrongUse(
                f"{deployment}: policy.{key} is {value!r}, {' or '.join(CHOICES[key])} is needed; correct it"
            )
    minutes = stated.get("latest_start_min", Policy.latest_start_min)
    if not isinstance(minutes, int) or isinstance(minutes, bool) or not 1 <= minutes <= LONGEST_MIN:
        raise WrongUse(
            f"{deployment}: policy.latest_start_min is {minutes!r}, a whole number from 1 to {LONGEST_MIN} is needed; correct it"
        )
    return Policy(**stated)


def policy_of_tags(tags: Iterable[str]) -> Policy:
    """The policy that the tags of a flow run state; the default for what they do not state."""
    stated: dict[str, Any] = {}
    for match in filter(None, map(TAG.fullmatch, tags)):
        key, value = match.groups()
        if key in CHOICES and value in CHOICES[key]:
            stated[key] = value
        elif key == "latest_start_min" and value.isdecimal() and 1 <= int(value) <= LONGEST_MIN:
            stated[key] = int(value)
    return Policy(**stated)
