"""Registers the deployments of a ``prefect.yaml``: what ``prefect deploy --all`` does, without asking who listens.

Prefect 3.8's own command ends in an error 422 from FastAPI 0.151 on: after each deployment it asks for the pool's workers with
null for two numbers, and since then FastAPI takes null for a value and no longer for one that is missing.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import yaml
from prefect import Flow, flow
from prefect.client.schemas.schedules import CronSchedule
from prefect.deployments.runner import RunnerDeployment

NOT_HERE = "deployments are registered from code that is not asynchronous"
ROOT = Path(__file__).resolve().parents[2]


def register(path: Path) -> list[str]:
    """Names of the deployments of a file, registered with the server that PREFECT_API_URL names; their pools must exist."""
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    return [_register(item) for item in content["deployments"]]


def _register(item: dict[str, Any]) -> str:
    source = flow.from_source(source=str(ROOT), entrypoint=item["entrypoint"])
    if not isinstance(source, Flow):
        raise TypeError(NOT_HERE)
    deployment = source.to_deployment(
        name=item["name"],
        description=item["description"],
        tags=item["tags"],
        parameters=item["parameters"],
        concurrency_limit=item["concurrency_limit"],
        schedules=[CronSchedule(cron=s["cron"], timezone=s["timezone"]) for s in item["schedules"]],
        work_pool_name=item["work_pool"]["name"],
    )
    if not isinstance(deployment, RunnerDeployment):
        raise TypeError(NOT_HERE)
    deployment.apply(work_pool_name=item["work_pool"]["name"])
    return f"{deployment.flow_name}/{deployment.name}"


if __name__ == "__main__":
    sys.stdout.write("\n".join(register(Path(sys.argv[1]))) + "\n")
